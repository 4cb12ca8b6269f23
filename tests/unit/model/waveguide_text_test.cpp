// Waveguides in the language: reading, errors, printing, expansion.
#include "core/laws/laws.h"
#include "core/model/faust/faust.h"
#include "core/model/language/print.h"
#include "core/model/topology.h"
#include "tests/support/app/messages.h"
#include "tests/support/harness.h"

namespace ressort::waveguide_text_test {
namespace {

using namespace support;
using messages::check_error;

const std::string heard = "@in1 frcInput [@s 0.2]\n@out1 posOutput [@s 0.7]\n";

std::string refused(const std::string& text, double rate_hz = 44100.0) {
  const auto made = compile_network(network_of(text), Preset{}, {.rate_hz = rate_hz});
  REQUIRE(!made);
  return std::to_string(made.error().line) + ":" + std::to_string(made.error().column) + " " +
         made.error().message;
}

}  // namespace

TEST_CASE("a waveguide's line is read correctly", "[waveguide_text]") {
  const Network network = network_of(
      "@f param 2.\n@s waveguide 1.5 f*110 [2 + f] 0.25 0.5\n@t openWaveguide 1. 50. 1. 0 0.\n"
      "@k spring [@s 0.3] [@t f/4] 1. 0.1\n" +
      heard);
  REQUIRE(network.macros.size() == 2);
  const Macro& s = network.macros[0];
  const auto value = [&](ArgumentId id) {
    return argument_value(network, id, parameter_values(network));
  };
  CHECK(s.kind == MacroKind::waveguide);
  CHECK(network.macros[1].kind == MacroKind::open_waveguide);
  CHECK(value(s.impedance) == 1.5);
  CHECK(value(s.frequency_hz) == 220.0);
  CHECK(value(s.t60_s) == 4.0);
  CHECK(value(s.brightness) == 0.25);
  CHECK(s.position == 0.5);
  CHECK(network_of(print_network(network)) == network);
}

TEST_CASE("errors in waveguides are reported", "[waveguide_text]") {
  check_error("@s waveguide -1. 220. 2. 0.5 0.\n" + heard, 1, 14,
              "a waveguide's impedance R must be above 0, found '-1.'");
  check_error("@s waveguide 1. 0 2. 0.5 0.\n" + heard, 1, 17,
              "a waveguide's frequency in Hz must be above 0, found '0'");
  check_error("@s waveguide 1. 220. 0. 0.5 0.\n" + heard, 1, 22,
              "a waveguide's T60 in seconds must be above 0, found '0.'");
  check_error("@s waveguide 1. 220. 2. 1.5 0.\n" + heard, 1, 25,
              "a waveguide's brightness goes from 0 to 1, found '1.5'");
  check_error("@s waveguide 1. 220. 2. 0.5\n" + heard, 1, 28,
              "'waveguide' takes 5 arguments (R HZ T60 BRIGHTNESS POSITION), found 4");
  check_error("@s waveguide 1. 220. 2. 0.5 0.\n@out1 posOutput [@s 0.2 0.3]\n", 2, 25,
              "found '0' where an operator or the end was expected");
}

TEST_CASE("a waveguide too short for its places is rejected", "[waveguide_text]") {
  CHECK(
      refused("@s waveguide 1. 9000. 2. 0.5 0.\n" + heard) ==
      "1:1 the frequency 9000 Hz of the waveguide 's' is too high: with this number of places the "
      "limit at this sample rate is 5880 Hz");
  CHECK(compile_network(network_of("@s waveguide 1. 9000. 2. 0.5 0.\n" + heard), Preset{},
                        {.rate_hz = 96000.0}));
  CHECK(refused("@f param 0.\n@s waveguide 1. f*100 2. 0.5 0.\n" + heard)
            .starts_with(
                "2:1 the frequency 0 Hz of the waveguide 's' is too low: the limit is 15 Hz"));
  CHECK(refused("@f param 0.\n@s waveguide f 100 2. 0.5 0.\n" + heard) ==
        "2:1 the impedance f of 's' is not above 0 when f = 0");
}

TEST_CASE("places with the same coordinate are merged, and a curved spring is split",
          "[waveguide_text]") {
  const Network whole = expand_macros(
      network_of("@s waveguide 1. 220. 2. 0.5 0.\n@m mass 1. 0. 0.\n"
                 "@a nlSpring3 @m [@s 0.2] 0.1 2. 0.01\n@b contact @m [@s 0.2] 1. 0.\n" +
                 heard));
  CHECK(whole.macros.empty());
  CHECK(whole.waveguides.size() == 1);
  CHECK(std::count_if(whole.masses.begin(), whole.masses.end(),
                      [](const Mass& mass) { return mass.kind == MassKind::junction; }) == 2);
  CHECK(whole.links[0].b == whole.links[1].b);
  CHECK(whole.links[0].b == whole.inputs[0].mass);
  REQUIRE(whole.links.size() == 3);
  CHECK(whole.links[2].law == Law::spring);
  CHECK(argument_value(whole, whole.links[2].arguments[0], {}) == 0.1);
  CHECK(argument_value(whole, whole.links[2].arguments[1], {}) == 0.01);
  CHECK(argument_value(whole, whole.links[0].arguments[1], {}) == 2.0);
  CHECK(whole.links[0].arguments[0] == no_argument);
  CHECK(expand_macros(whole) == whole);
}

TEST_CASE("a waveguide that the FAUST export cannot write is reported with its line",
          "[waveguide_text]") {
  const std::string guide = "@p param 0.3\n\n@s waveguide 1. 220. 2. 0.5 0.\n";
  const auto refused = [&](const std::string& lines, int line, const std::string& why) {
    const auto text = faust_text(network_of(guide + lines + heard), {});
    REQUIRE(!text);
    CHECK(text.error().line == line);
    INFO(text.error().message);
    CHECK(text.error().message.find(why) != std::string::npos);
  };
  refused("@m mass 1. 0. 0.\n@k spring @m [@s 0.3] 1.\n@l nlPluck @m [@s 0.6] 1. 0.1\n", 6,
          "'l' and 'k' move the same mass, body or place next to a waveguide");
  refused(
      "@m mass 1. 0. 0.\n@n mass 1. 0. 0.\n@k spring @m [@s 0.3] 1.\n@l spring @n [@s 0.3] 1.\n", 7,
      "Attach them to different places and bodies");
  refused(
      "@in9 frcInput [@s 0.6]\n@f audioParam @in2\n@t waveguide 1. f 2. 0.5 0.\n"
      "@out2 posOutput [@t 0.3]\n",
      6, "is tuned or damped by an audio input");
  refused("@in2 frcInput [@s p]\n", 3, "moves with a parameter");
}

}  // namespace ressort::waveguide_text_test
