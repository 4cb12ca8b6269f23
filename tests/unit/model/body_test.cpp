// Bodies and their modes: reading, errors, printing, expansion.
#include <cmath>
#include <numbers>

#include "core/model/language/print.h"
#include "core/model/topology.h"
#include "tests/support/app/messages.h"
#include "tests/support/harness.h"

namespace ressort::body_test {
namespace {

using namespace support;
using messages::check_error;

const std::string bell =
    "@bell body 40. rim waist crown\n"
    "@b1 mode @bell 310.7 4.2 1. -0.61 0.02\n"
    "@b2 mode @bell 601.2 3.1 0.8 0.35 0.9\n"
    "@out1 posOutput [@bell rim]\n";

}  // namespace

TEST_CASE("a body consists of modes and places", "[body]") {
  const Network network = network_of(bell);
  REQUIRE(network.macros.size() == 1);
  CHECK(network.macros[0].kind == MacroKind::body);
  CHECK(network.macros[0].length == 2);
  CHECK(network.macros[0].places == std::vector<std::string>{"rim", "waist", "crown"});
  REQUIRE(network.modes.size() == 2);
  CHECK(network.modes[0].name == "b1");
  CHECK(network.modes[1].shape == std::vector<double>{0.8, 0.35, 0.9});
}

TEST_CASE("modes of a body may be anywhere in the text", "[body]") {
  const Network network = network_of(
      "@out1 posOutput [@b x]\n@b1 mode @b 3. 1. 1.\n@a1 mode @a 1. 1. 1.\n@b2 mode @b 4. 1. 1.\n"
      "@a body 1. y\n@b body 1. x\n@a2 mode @a 2. 1. 1.\n");
  std::vector<std::string> names;
  for (const BodyMode& mode : network.modes) {
    names.emplace_back(mode.name);
  }
  CHECK(names == std::vector<std::string>{"a1", "a2", "b1", "b2"});
}

TEST_CASE("a mode is an oscillator of its body's mass", "[body]") {
  const Network network = expand_macros(network_of(bell));
  REQUIRE(network.masses.size() == 3);
  const Mass& first = network.masses[1];
  CHECK(first.kind == MassKind::oscillator);
  CHECK(first.is_mode);
  const double omega = 2.0 * std::numbers::pi * 310.7 / 44100.0;
  const double alpha = std::log(1000.0) / 4.2 / 44100.0;
  CHECK(argument_value(network, first.mass, {}) == 40.0);
  CHECK(argument_value(network, first.stiffness, {}) ==
        Approx(40.0 * (omega * omega + alpha * alpha)).epsilon(1e-14));
  CHECK(argument_value(network, first.damping, {}) == Approx(80.0 * alpha).epsilon(1e-14));
  CHECK(network.shapes == std::vector<double>{1.0, 0.8, -0.61, 0.35, 0.02, 0.9});
}

TEST_CASE("a place on a body is named or lies between two named places", "[body]") {
  const auto place = [](const std::string& written) {
    const Network network =
        network_of("@u param 0.1\n" + bell + "@out2 posOutput [@bell " + written + "]\n");
    return argument_value(network, network.taps[1].u, parameter_values(network));
  };
  CHECK(place("rim") == 0.0);
  CHECK(place("waist") == 0.5);
  CHECK(place("crown") == 1.0);
  CHECK(place("0.3") == 0.3);
  CHECK(place("u") == 0.1);
  CHECK(place("1-u") == Approx(0.9));
}

TEST_CASE("errors in bodies are reported", "[body]") {
  check_error("@b body 1. x\n@out1 posOutput [@b x]\n", 1, 1,
              "the body '@b' has no modes: each is a line like '@b_1 mode @b 440. 2. 1.'");
  check_error(bell + "@b3 mode @bell 800. 1. 0.5 0.5\n", 5, 28,
              "the body '@bell' has 3 places (rim waist crown), so a mode needs as many "
              "displacements; found 2");
  check_error(bell + "@b3 mode @bell 0. 1. 1. 1. 1.\n", 5, 16,
              "a mode's frequency in Hz must be above 0, found '0.'");
  check_error(bell + "@b3 mode @bell 100. -1 1. 1. 1.\n", 5, 21,
              "a mode's T60 in seconds must be above 0, found '-1'");
  check_error(bell + "@b3 mode @bel 100. 1. 1. 1. 1.\n", 5, 10,
              "found '@bel' where '@' and the label of a body were expected; did you mean "
              "'@bell'?");
  check_error(bell + "@out2 posOutput [@bell rimm]\n", 5, 24,
              "the body '@bell' has no place called 'rimm' (it has rim, waist, crown); did you "
              "mean 'rim'?");
  check_error(bell + "@out2 posOutput [@bell]\n", 5, 17,
              "'@bell' is a body: a place on it needs its name, [@bell rim]");
  check_error("@k param 2.\n@r spring @g [@bell rim] k\n@g ground 0.\n" + bell +
                  "@b3 mode @bell 100. 1. k 1. 1.\n",
              8, 24, "found 'k' where a displacement, a number without parameters, was expected");
  check_error("@b body 1. x x\n@b1 mode @b 1. 1. 1. 1.\n@out1 posOutput [@b x]\n", 1, 14,
              "the body has two places called 'x'");
  check_error(
      "@b body 1. 2x\n@b1 mode @b 1. 1. 1.\n@out1 posOutput [@b 0]\n", 1, 12,
      "'2x' is not a name for a place: use letters, digits and '_', and do not start with a "
      "digit");
}

TEST_CASE("printed bodies read back unchanged", "[body]") {
  const std::string text =
      "@p param 2\n@b body [1 + p] x y z\n@m1 mode @b 100*p 1/p -1 0.5 [1 / 3]\n"
      "@in1 frcInput [@b x]\n@l contact [@b p/4] [@b z] 1 0.1\n@out1 posOutput [@b 0.25]\n";
  const Network network = network_of(text);
  const std::string printed = print_network(network);
  INFO(printed);
  CHECK(printed.find("@b body [1+p] x y z\n@m1 mode @b 100*p 1/p -1 0.5 0.333333333333333") !=
        std::string::npos);
  CHECK(printed.find("@l contact [@b p/4] [@b z] 1 0.1\n") != std::string::npos);
  CHECK(network_of(printed) == network);
}

}  // namespace ressort::body_test
