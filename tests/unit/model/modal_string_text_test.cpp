// Modal strings in the language: reading, errors, printing, expansion.
#include <cmath>
#include <numbers>

#include "core/model/language/print.h"
#include "core/model/topology.h"
#include "tests/support/app/messages.h"
#include "tests/support/harness.h"

namespace ressort::modal_string_text_test {
namespace {

using namespace support;
using messages::check_error;

constexpr double pi = std::numbers::pi;

const std::string heard = "@in1 frcInput [@s 0.2]\n@out1 posOutput [@s bridge]\n";

}  // namespace

TEST_CASE("a modal string's line is read correctly and printed unchanged", "[modal_string_text]") {
  const Network network = network_of(
      "@f param 110.\n@u param 0.3\n@s modalString 40 2. 2*f 3e-4 0.5 f/1000 1e-6\n"
      "@t modalString 3 1. f 0 [1 + u] 0 0 3 u*4 0.25\n@k spring [@s u/2] [@t bridge] 1e-3 0\n" +
      heard);
  REQUIRE(network.macros.size() == 2);
  const Macro& s = network.macros[0];
  const Macro& t = network.macros[1];
  const auto value = [&](ArgumentId id) {
    return argument_value(network, id, parameter_values(network));
  };
  CHECK(s.kind == MacroKind::modal_string);
  CHECK(s.length == 40);
  CHECK(s.width == 1);
  CHECK(value(s.mass) == 2.0);
  CHECK(value(s.frequency_hz) == 220.0);
  CHECK(value(s.inharmonicity) == 3e-4);
  CHECK(value(s.losses[1]) == 0.11);
  CHECK(s.bridge_loss == no_argument);
  CHECK(t.width == 3);
  CHECK(value(t.losses[0]) == 1.3);
  CHECK(value(t.spread_cents) == 1.2);
  CHECK(value(t.bridge_loss) == 0.25);
  const std::string printed = print_network(network);
  INFO(printed);
  CHECK(printed.find("@s modalString 40 2 2*f 0.0003 0.5 f/1000 0.000001\n") != std::string::npos);
  CHECK(printed.find("@t modalString 3 1 f 0 [1+u] 0 0 3 u*4 0.25\n") != std::string::npos);
  CHECK(printed.find("@k springDamper [@s u/2] [@t bridge] 0.001 0\n") != std::string::npos);
  CHECK(network_of(printed) == network);
}

TEST_CASE("errors in modal strings are reported", "[modal_string_text]") {
  check_error("@s modalString 0 1. 220. 0 1 0 0\n" + heard, 1, 16,
              "found '0' where a number of nodes from 1 to 4000000 was expected");
  check_error("@s modalString 9 0. 220. 0 1 0 0\n" + heard, 1, 18,
              "a mass must be above 0, found '0.'");
  check_error("@s modalString 9 1. 0 0 1 0 0\n" + heard, 1, 21,
              "a string's frequency in Hz must be above 0, found '0'");
  check_error("@s modalString 9 1. 220. -1e-4 1 0 0\n" + heard, 1, 26,
              "a string's inharmonicity B must not be below 0, found '-1e-4'");
  check_error("@s modalString 9 1. 220. 0 1 -1 0\n" + heard, 1, 30,
              "a loss in 1/s must not be below 0, found '-1'");
  check_error("@s modalString 9 1. 220. 0 1 0 0 2\n" + heard, 1, 34,
              "STRINGS, CENTS and BRIDGE belong together: give all three or none");
  check_error("@s modalString 9 1. 220. 0 1 0 0 5 1 1\n" + heard, 1, 34,
              "a note has 1 to 4 strings, found '5'");
  check_error("@s modalString 9 1. 220. 0 1 0 0 2 1 -1\n" + heard, 1, 38,
              "the bridge's loss in 1/s must not be below 0, found '-1'");
  check_error("@s modalString 9 1. 220. 0 1 0 0\n@out1 posOutput @s\n", 2, 17,
              "'@s' is a modalString: a place on it needs one coordinate, [@s u], from 0 to 1, or "
              "its bridge, [@s bridge]");
}

TEST_CASE("numbers of a modal string that parameters set are checked", "[modal_string_text]") {
  const auto refused = [](const std::string& text) {
    const auto made = compile_network(network_of(text + heard), Preset{}, {});
    REQUIRE(!made);
    return made.error().message;
  };
  CHECK(refused("@p param -1\n@s modalString 9 1. 220. 0 p 0 0\n") ==
        "the loss p of 's' is below 0 when p = -1");
  CHECK(refused("@p param 0\n@s modalString 9 1. 220*p 0 1 0 0\n") ==
        "the frequency 220*p of 's' is not above 0 when p = 0");
}

TEST_CASE("a modal string becomes the modes that its numbers describe", "[modal_string_text]") {
  constexpr double hz = 261.6;
  constexpr double b = 3.2e-4;
  const Network network = expand_macros(network_of(
      "@f param 261.6\n@b param 3.2e-4\n@s modalString 20 3. f b 0.88 0.35 1e-4 2 1.5 0.25\n" +
      heard));
  const std::vector<double> values = parameter_values(network);
  std::vector<const Mass*> modes;
  for (const Mass& mass : network.masses) {
    if (mass.is_mode) {
      modes.push_back(&mass);
    }
  }
  REQUIRE(modes.size() == 40);
  for (std::size_t i = 0; i < modes.size(); ++i) {
    const double n = static_cast<double>(i / 2) + 1.0;
    const double detuned = std::exp2((i % 2 == 0 ? -0.75 : 0.75) / 1200.0);
    const double omega =
        2.0 * pi * n * hz * detuned * std::sqrt((1.0 + b * n * n) / (1.0 + b)) / 44100.0;
    const double sigma = (0.88 + 0.35 * n + 1e-4 * n * n * n) / 44100.0;
    CHECK(argument_value(network, modes[i]->mass, values) == 1.5);
    CHECK(argument_value(network, modes[i]->stiffness, values) ==
          Approx(1.5 * (omega * omega + sigma * sigma)).epsilon(1e-13));
    CHECK(argument_value(network, modes[i]->damping, values) == Approx(3.0 * sigma).epsilon(1e-13));
  }
  // The places: the mean of two strings that are struck, the bridge's force, and its motion.
  for (const Tap& tap : network.taps) {
    REQUIRE(tap.length == 40);
    REQUIRE(tap.places == 1);
  }
  REQUIRE(network.taps.size() == 3);
  for (std::uint32_t i = 0; i < 40; ++i) {
    const double n = i / 2 + 1;
    const double sign = i / 2 % 2 == 0 ? 1.0 : -1.0;
    const auto shape = [&](std::size_t tap) { return network.shapes[network.taps[tap].shape + i]; };
    CHECK(shape(0) == Approx(0.5 * std::sin(pi * n * 0.2)).margin(1e-14));
    CHECK(shape(1) == 0.5 * n * sign);
    CHECK(shape(2) == sign);
  }
  REQUIRE(network.links.size() == 1);
  CHECK(argument_value(network, network.links[0].arguments[1], values) ==
        Approx(3.0 * 0.25 / 44100.0).epsilon(1e-14));
}

}  // namespace ressort::modal_string_text_test
