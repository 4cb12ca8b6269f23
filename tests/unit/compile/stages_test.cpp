// Each stage of compilation separately, on networks small enough to solve by hand.
#include "core/analysis/linear.h"
#include "core/compile/accuracy/pitches.h"
#include "core/compile/instrument.h"
#include "core/compile/make_engine.h"
#include "core/compile/prove.h"
#include "core/compile/schemes.h"
#include "core/compile/tune.h"
#include "core/model/number_check.h"
#include "tests/support/player.h"

namespace ressort::stages_test {
namespace {

using namespace support;

constexpr double infinity = std::numeric_limits<double>::infinity();

// M = 2 on a spring of K to a ground: stable while 4M - K - 2Z > 0.
const std::string held_mass =
    "@K param 0.5\n@g ground 0.\n@m mass 2. 0. 0.\n@s springDamper @g @m K 0.1\n"
    "@in1 frcInput @m\n@out1 posOutput @m\n";

ParameterBox at(double value) {
  return {{value}, {value}};
}

}  // namespace

TEST_CASE("The default range of a parameter ends at four times its value", "[stages]") {
  const Network network = network_of(
      "@a param 0.3\n@b param -2\n@c param 0\n@M param 8\n@g ground 0.\n@o osc M a b 0. 0.\n@s "
      "spring @g @o c\n@out1 posOutput @o\n");
  const auto asked = requested_ranges(network, Preset{}, false);
  const auto range = [&](std::size_t i) { return std::pair(asked[i].minimum, asked[i].maximum); };
  CHECK(range(0) == std::pair(0.0, 1.2));
  CHECK(range(1) == std::pair(-8.0, 8.0));
  CHECK(range(2) == std::pair(0.0, 1.0));
  CHECK(range(3) == std::pair(2.0, 32.0));  // a mass must not become 0
  CHECK(start_values(asked, {{"b", 7.0}}, false) == std::vector{0.3, -2.0, 0.0, 8.0});
  CHECK(start_values(asked, {{"b", 7.0}}, true) == std::vector{0.3, 7.0, 0.0, 8.0});
}

TEST_CASE("A formula that is not finite is reported at its line", "[stages]") {
  const Network network = network_of("@P param 1\n@o osc 1. 1/P 0. 0. 0.\n@out1 posOutput @o\n");
  CHECK_FALSE(find_invalid_number(network, std::vector{1.0}, 1.0));
  const auto error = find_invalid_number(network, std::vector{0.0}, 1.0);
  REQUIRE(error);
  CHECK(error->message == "the stiffness 1/P of 'o' is not finite when P = 0");
  CHECK(error->line == 2);
  // At half the rate stiffness is four times as large.
  CHECK_FALSE(find_invalid_number(network, std::vector{1e-308}, 1.0));
  CHECK(find_invalid_number(network, std::vector{1e-308}, 2.0));
}

TEST_CASE("A mode whose coefficients overflow is reported", "[stages]") {
  const auto told = [](const std::string& mass, const std::string& mode) {
    const Network network =
        network_of("@b body " + mass + " p\n@b1 mode @b " + mode + " 1.\n@out1 posOutput [@b p]\n");
    const auto error = find_invalid_number(network, std::vector<double>{}, 1.0);
    return error ? error->message : "";
  };
  CHECK(told("1.", "1e150 1.") == "");
  CHECK(told("1.", "1e160 1.") == "the frequency 1e160 of 'b1' is too high");
  CHECK(told("1e10", "1e150 1.") == "the frequency 1e150 of 'b1' is too high");
  CHECK(told("1.", "300. 1e-150") == "");
  CHECK(told("1.", "300. 1e-160") == "the T60 1e-160 of 'b1' is too short");
}

TEST_CASE("Tables leave out culled masses and start at the given values", "[stages]") {
  const Network network = network_of(held_mass + "@lost mass 1. 0. 1.\n");
  const Machine machine = tabulate(network, cull(network), {}, std::vector{0.7}, 88200.0, true);
  CHECK(machine.rate_ratio == 0.5);
  CHECK(machine.parameters == std::vector{0.7});
  CHECK(machine.channels == 1);
  REQUIRE(machine.parts.size() == 1);
  const Program& program = machine.parts[0];
  CHECK(program.moving == 1);
  REQUIRE(program.link_runs.size() == 1);
  // Per sample at twice the rate: K/4, Z/2.
  const auto value = [&](std::size_t argument) {
    return coefficient_value(program,
                             program.coefficients[program.link_runs[0].coefficients[argument]],
                             machine.parameters, 1.0);
  };
  CHECK(value(0) == Approx(0.175).epsilon(1e-15));
  CHECK(value(1) == Approx(0.05).epsilon(1e-15));
}

TEST_CASE("An unstable range is narrowed, and the request stays unchanged", "[stages]") {
  const Network network = network_of(held_mass);
  Preset preset = struck(1);
  preset.parameters.push_back({"K", 0.5, 0.1, 9.0, {7, 3}});
  const auto asked = requested_ranges(network, preset, false);
  const StabilityCheck check = check_stability({.written = network,
                                                .expanded = network,
                                                .preset = preset,
                                                .parameters = asked,
                                                .start = std::vector{0.5},
                                                .reach = {}});
  CHECK(check.verdict == Verdict::stable);
  // 4M - 2Z = 7.8, rounded inwards to six digits.
  CHECK(check.parameters[0].maximum == 7.79999);
  CHECK(check.parameters[0].minimum == 0.1);
  CHECK(check.limits[0].highest == 7.79999);
  REQUIRE(check.narrowed.size() == 1);
  CHECK(check.narrowed[0].line == 7);
  CHECK(asked[0].maximum == 9.0);
  CHECK(proved_box(check, preset).highest[0] == 7.79999);
  CHECK(preset_box(asked, preset).highest[0] == 9.0);
}

TEST_CASE("The margin for keys shrinks towards the limits of a parameter", "[stages]") {
  const Network network = network_of(held_mass);
  const std::vector<Limits> limits = {{-infinity, 1.0}};
  const Margins margins = find_margins(network, {}, at(0.5), limits, 1.0);
  CHECK(margins.whole == Approx(7.8 / 0.5).epsilon(1e-12));
  CHECK(margins.keys == Approx(0.98 * 7.8 / 0.5).epsilon(1e-12));
  REQUIRE(margins.home.size() == 1);
  CHECK(margins.home[0].lowest == -infinity);
  CHECK(margins.home[0].highest == 0.5);
  REQUIRE(margins.away.size() == 8);
  CHECK(margins.away[3] == Approx(0.98 * 7.8 / 0.75).epsilon(1e-12));
  CHECK(margins.away[7] == Approx(0.98 * 7.8 / 1.0).epsilon(1e-12));
  // At half the rate K counts four times, Z twice.
  CHECK(find_margins(network, {}, at(0.5), {}, 2.0).whole == Approx(7.6 / 2.0).epsilon(1e-12));
  CHECK(find_margins(network, {}, at(0.5), {}, 1.0).away.empty());
  // Passive links have no stability limit.
  const Network floor = network_of("@g ground 0.\n@m mass 1. 0. 1.\n@c contact @g @m 3. 0.\n");
  const std::vector<Scheme> passive = {Scheme::discrete_gradient};
  CHECK(find_margins(floor, {}, {}, {}, 1.0).whole == Approx(4.0 / 3.0).epsilon(1e-12));
  CHECK(find_margins(floor, passive, {}, {}, 1.0).whole == most_bounded);
}

TEST_CASE("The bound of a resting part is the compliance of its springs", "[stages]") {
  const Network network = network_of(
      "@g ground 0.\n@m mass 1. 0. 1.\n@n mass 1. 0. 0.\n@a spring @g @m 0.5\n"
      "@b spring @m @n 0.25\n@out1 posOutput @m\n@out2 posOutput @n\n@out3 frcOutput @g\n");
  const auto bounds = [&](Network heard) {
    return make_rest_bounds(heard, make_machine(heard, 44100.0, true), {});
  };
  CHECK_FALSE(bounds(network)[0]);  // because an output reads a force
  Network silent = network;
  silent.outputs.pop_back();
  const auto bound = bounds(silent)[0];
  REQUIRE(bound);
  // Springs in series: 1/0.5, and 1/0.5 + 1/0.25.
  REQUIRE(bound->compliances.size() == 2);
  CHECK(bound->compliances[0] == Approx(2.0).epsilon(1e-12));
  CHECK(bound->compliances[1] == Approx(6.0).epsilon(1e-12));
}

TEST_CASE("Keys tune the lowest mode at the engine's sample rate", "[stages]") {
  const Network network = network_of(held_mass);
  const auto shapes = lowest_shapes(network, std::vector{0.5});
  REQUIRE(shapes);
  const Proof proof{.margins = {.whole = 15.6, .keys = 4.0}};
  const TunedKeys keys{.mode = shapes->mode,
                       .pitches = make_pitches(*shapes, {}, 88200.0, 0.5),
                       .highest_factor = 4.0};
  const Playing playing = make_playing(network, struck(1), proof, keys, false, 3, 0.25);
  CHECK(playing.voices == 3);
  CHECK(playing.gain == 0.25);
  CHECK(playing.tuning == Tuning::keyboard);
  // cos(theta) = (2 - factor K/M r^2 - Z/M r) / (2 sqrt(1 - Z/M r))
  const double cosine = std::cos(2.0 * std::numbers::pi * 440.0 / 88200.0);
  CHECK(playing.pitches.factor_at(440.0) ==
        Approx((2.0 - 0.025 - 2.0 * std::sqrt(0.975) * cosine) / 0.0625).epsilon(1e-11));
  REQUIRE(playing.controls.size() == 1);
  CHECK(playing.controls[0].gesture == Gesture::impulse);
  const Instrument instrument = make_instrument(network, struck(1), proof, keys, 3, 0.25);
  // cos(theta) = (2 - 4 * 0.0625 - 0.025) / (2 sqrt(1 - 0.025))
  CHECK(instrument.highest_frequency_hz ==
        Approx(88200.0 / (2.0 * std::numbers::pi) * std::acos(1.725 / (2.0 * std::sqrt(0.975))))
            .epsilon(1e-6));  // between two semitones
  CHECK(make_playing(network, struck(1), proof, {}, false, 3, 0.25).tuning == Tuning::fixed);
}

TEST_CASE("The gain found for an impulse on one mass follows from its amplitude", "[stages]") {
  // K = 2 M: x[n+1] = -x[n-1]. A blow of 0.1 of a force, at velocity 0.8, moves M = 1 by 0.08.
  const Network network =
      network_of("@o osc 1. 2. 0. 0. 0.\n@in1 frcInput @o\n@out1 posOutput @o\n");
  const Machine machine = make_machine(network, 44100.0, true);
  const Playing playing = make_playing(network, struck(1), {}, {}, false, 1, 1.0);
  const auto gain = find_gain(machine, playing, Precision::float64, best_isa(), {});
  REQUIRE(gain);
  CHECK(*gain == Approx(0.5 / 0.08).epsilon(1e-12));
}

}  // namespace ressort::stages_test
