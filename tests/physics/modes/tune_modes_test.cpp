// Modes tuned to targets, and networks made from modes. The results are judged by the modes of the
// printed model; modes_test.cpp verifies those against the sound.
#include <cmath>
#include <numbers>

#include "core/analysis/modes/body.h"
#include "core/analysis/modes/scaling.h"
#include "core/analysis/modes/tune.h"
#include "core/model/language/print.h"
#include "tests/support/harness.h"

namespace ressort::tune_modes_test {

using namespace support;

namespace {

double cents(double hz, double wanted) {
  return 1200.0 * std::log2(hz / wanted);
}

NetworkModes modes_of(const Network& network, const ModeOptions& options = {}) {
  auto found = find_modes(network, parameter_values(network), options);
  INFO((found ? "" : found.error().message));
  REQUIRE(found);
  return *std::move(found);
}

// Prints and parses the network.
Network again(const Network& network) {
  return network_of(print_network(network));
}

// Masses held and joined at random, with individual springs; driven at the first, heard at the
// last.
std::string random_text(std::uint64_t seed, std::size_t count) {
  Random random(seed + 100);
  const auto number = [&](double low, double high) { return show(random.uniform(low, high)); };
  std::string text = "@g ground 0.\n";
  std::size_t links = 0;
  const auto join = [&](const std::string& a, const std::string& b) {
    text += "@l" + std::to_string(links++) + " springDamper " + a + " " + b + " " +
            number(0.005, 0.1) + " " + number(1e-5, 1e-3) + "\n";
  };
  for (std::size_t i = 0; i < count; ++i) {
    text += "@m" + std::to_string(i) + " mass " + number(0.7, 3.0) + " 0. 0.\n";
  }
  for (std::size_t i = 1; i < count; ++i) {
    join("@m" + std::to_string(i), "@m" + std::to_string(random.below(i)));
    if (random.below(2) == 0) {
      join("@m" + std::to_string(i), "@g");
    }
  }
  join("@m0", "@g");
  return text + "@in1 frcInput @m0\n@out1 posOutput @m" + std::to_string(count - 1) + "\n";
}

const std::string two_strings =
    "@k param 0.05\n"
    "@a string 20 1. k 0.0002 0. 0.\n@b string 30 1.5 0.1 0.0001 0.00005 0. 0.\n"
    "@o osc 2. [k * 0.5] 0.0002 0. 0.\n@l springDamper @o [@b 0.3] [k + 0.01] 0.001\n"
    "@in1 frcInput [@a 0.3]\n@in2 frcInput [@b 0.4]\n@out1 posOutput [@a 0.6]\n"
    "@out2 posOutput [@b 0.7]\n";

// The response of a body at one place to an impulse at another, by each mode's recurrence.
std::vector<double> played(const PlacedModes& modes, std::size_t from, std::size_t to,
                           std::size_t frames, double rate_hz) {
  std::vector<double> sound(frames, 0.0);
  for (const PlacedMode& mode : modes.modes) {
    const double r = std::pow(10.0, -3.0 / (rate_hz * mode.t60_s));
    const double turn = 2.0 * r * std::cos(2.0 * std::numbers::pi * mode.frequency_hz / rate_hz);
    long double before = 0.0L;
    long double now = mode.displacement[from] / modes.mass;
    for (double& x : sound) {
      x += static_cast<double>(now) * mode.displacement[to];
      const long double next = turn * now - static_cast<long double>(r) * r * before;
      before = now;
      now = next;
    }
  }
  return sound;
}

}  // namespace

TEST_CASE("a mode of a model or a part is tuned to a note and a decay", "[tune_modes]") {
  const Network network = network_of(two_strings);
  const double start_hz = modes_of(network).modes[0].frequency_hz;
  for (const double factor : {0.5, 0.97, 1.9}) {
    for (const char* const part : {"", "a"}) {
      INFO("times " << factor << ", part '" << part << "'");
      const NetworkModes before = modes_of(network);
      // The part's lowest mode is the lowest with a level at its output.
      std::size_t mode = 0;
      while (before.modes[mode].levels[0] < 1e-9) {
        ++mode;
      }
      const double wanted = before.modes[mode].frequency_hz * factor;
      const auto tuned =
          tune_mode(network, parameter_values(network),
                    {.mode = mode, .frequency_hz = wanted, .t60_s = 1.25, .part = part}, {});
      INFO((tuned ? "" : tuned.error().message));
      REQUIRE(tuned);
      double nearest = HUGE_VAL;
      double t60_s = 0.0;
      const NetworkModes found = modes_of(again(tuned->network));
      for (const NetworkMode& there : found.modes) {
        if (std::fabs(cents(there.frequency_hz, wanted)) < std::fabs(nearest)) {
          nearest = cents(there.frequency_hz, wanted);
          t60_s = there.t60_s;
        }
      }
      CHECK(std::fabs(nearest) < 1e-3);
      CHECK(std::fabs(t60_s / 1.25 - 1.0) < 1e-6);
    }
  }
  CHECK(start_hz > 0.0);
}

TEST_CASE("impossible tunings report the reason", "[tune_modes]") {
  const Network network = network_of(two_strings);
  const auto message = [&](const TuneTarget& target) {
    const auto tuned = tune_mode(network, parameter_values(network), target, {});
    REQUIRE(!tuned);
    return tuned.error().message;
  };
  CHECK(message({.mode = 500, .frequency_hz = 200.0}).find("there is no mode 501") == 0);
  CHECK(message({.mode = 0, .frequency_hz = 200.0, .part = "x"}).find("expected the name") == 0);
  // The lowest mode belongs to one string; the other's springs do not affect it.
  const NetworkModes modes = modes_of(network);
  const std::string other = modes.modes[0].levels[0] > 1e-9 ? "b" : "a";
  CHECK(message({.mode = 0, .frequency_hz = 200.0, .part = other}).find("hardly") !=
        std::string::npos);
}

TEST_CASE("springs are found for a list of frequencies", "[tune_modes]") {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const Network network = network_of(random_text(seed, 12));
    Random random(seed + 7);
    std::vector<double> wanted;
    for (std::size_t i = 0; i < 6; ++i) {
      const double hz = modes_of(network).modes[i].frequency_hz * random.uniform(0.8, 1.25);
      wanted.push_back(hz);
    }
    std::sort(wanted.begin(), wanted.end());
    INFO("seed " << seed);
    const auto tuned = tune_modes(network, parameter_values(network), wanted, {});
    INFO((tuned ? "" : tuned.error().message));
    REQUIRE(tuned);
    const NetworkModes found = modes_of(again(*tuned));
    for (std::size_t i = 0; i < wanted.size(); ++i) {
      CHECK(std::fabs(cents(found.modes[i].frequency_hz, wanted[i])) < 1.0);
    }
  }
}

TEST_CASE("a one-line string is tuned to a harmonic series", "[tune_modes]") {
  const Network network = network_of(
      "@s string 12 1. 0.05 0.0001 0. 0.\n@in1 frcInput [@s 0.3]\n@out1 posOutput [@s 0.6]\n");
  const std::vector<double> wanted = {220.0, 440.0, 660.0};
  const auto tuned = tune_modes(network, {}, wanted, {});
  INFO((tuned ? "" : tuned.error().message));
  REQUIRE(tuned);
  const NetworkModes found = modes_of(*tuned);
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    CHECK(std::fabs(cents(found.modes[i].frequency_hz, wanted[i])) < 1.0);
  }
}

TEST_CASE("a decay law applies to any structure", "[tune_modes]") {
  const auto law = decay_law({{100.0, 6.0}, {3000.0, 0.8}});
  REQUIRE(law);
  CHECK(std::fabs(law->t60_s(100.0) - 6.0) < 1e-12);
  CHECK(std::fabs(law->t60_s(3000.0) - 0.8) < 1e-12);
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    const std::string text = seed == 0 ? two_strings : random_text(seed, 15);
    const Network dressed = again(with_decay(network_of(text), *law));
    std::size_t heard = 0;
    for (const NetworkMode& mode : modes_of(dressed, {.scheme = ModeScheme::continuous}).modes) {
      // f is the undamped frequency; the pole's differs by (a + b f^2)^2 / 4 pi^2.
      const double loss = 3.0 * std::numbers::ln10 / mode.t60_s;
      const double undamped_hz = std::hypot(mode.frequency_hz, loss / (2.0 * std::numbers::pi));
      CHECK(std::fabs(mode.t60_s / law->t60_s(undamped_hz) - 1.0) < 1e-8);
      ++heard;
    }
    CHECK(heard >= 15);
    // The published scheme agrees to 1 % far below the rate.
    for (const NetworkMode& mode : modes_of(dressed).modes) {
      if (mode.frequency_hz < 1000.0) {
        CHECK(std::fabs(mode.t60_s / law->t60_s(mode.frequency_hz) - 1.0) < 0.01);
      }
    }
  }
  CHECK(!decay_law({}));
  CHECK(!decay_law({{100.0, 0.0}}));
  CHECK(!decay_law({{-1.0, 2.0}}));
  // The law cannot have more loss at low frequencies than at high ones; a constant is nearest.
  CHECK(decay_law({{100.0, 1.0}, {3000.0, 2.0}})->b == 0.0);
}

TEST_CASE("a network is played by its own body", "[tune_modes]") {
  // Proportional dampers, so that modes are real.
  const auto law = decay_law({{100.0, 2.0}, {3000.0, 0.4}});
  for (std::uint64_t seed = 0; seed < 4; ++seed) {
    const double rate_hz = seed % 2 == 0 ? 44100.0 : 48000.0;
    const Network network = with_decay(network_of(random_text(seed, 14)), *law);
    const PlacedModes body = placed_modes(modes_of(network, {.rate_hz = rate_hz}));
    REQUIRE(body.places == std::vector<std::string>{"in1", "out1"});
    CHECK(body.left_out < 1e-9);
    Bare<double> bare(make_program(network, rate_hz, true));
    std::vector<double> expected{bare.step({1.0})[0]};
    while (expected.size() < 6000) {
      expected.push_back(bare.step({0.0})[0]);
    }
    const std::vector<double> heard = played(body, 0, 1, expected.size(), rate_hz);
    Comparison comparison;
    for (std::size_t n = 0; n < heard.size(); ++n) {
      comparison.add(expected[n], heard[n]);
    }
    INFO("seed " << seed << ", off by " << comparison.relative());
    CHECK(comparison.peak > 0.0);
    CHECK(comparison.relative() < 1e-10);
  }
}

TEST_CASE("a body's text names its places and modes", "[tune_modes]") {
  PlacedModes body{.name = "bell", .mass = 40.0, .places = {"rim", "waist"}};
  body.modes = {{310.7, 4.2, {1.0, -0.61}}, {601.2, HUGE_VAL, {0.8, 0.35}}};
  CHECK(body_text(body) ==
        "@bell body 40 rim waist\n@bell1 mode @bell 310.7 4.2 1 -0.61\n"
        "@bell2 mode @bell 601.2 1000000000 0.8 0.35\n");
}

TEST_CASE("a chain's first mass responds like a place of a body", "[tune_modes]") {
  Random random(5);
  for (const std::size_t count : {1u, 2u, 8u, 40u}) {
    PlacedModes body{.mass = random.uniform(0.5, 40.0), .places = {"rim"}};
    const DecayLaw law{.a = 2.0, .b = 1e-6};
    double hz = 80.0;
    for (std::size_t i = 0; i < count; ++i) {
      hz *= random.uniform(1.02, 1.15);
      // A decay that the chain's dampers can have, in terms of the scheme's k, which is close to
      // f^2.
      const double k = 2.0 - 2.0 * std::cos(2.0 * std::numbers::pi * hz / 44100.0);
      const double f = 44100.0 / (2.0 * std::numbers::pi) * std::sqrt(k);
      body.modes.push_back({hz, law.t60_s(f), {random.uniform(-1.0, 1.0)}});
    }
    const auto chain = chain_of(body, "rim");
    INFO(count << " modes");
    REQUIRE(chain);
    CHECK(chain->worst_t60_percent < 1.0);
    Network network = again(chain->network);
    CHECK(network.links.size() == count - 1);
    network.inputs = {{.number = 1, .is_force = true, .mass = 0}};
    network.outputs = {{.number = 1, .mass = 0}};
    const NetworkModes found = modes_of(network);
    REQUIRE(found.modes.size() == count);
    std::sort(body.modes.begin(), body.modes.end(), [](const PlacedMode& a, const PlacedMode& b) {
      return a.frequency_hz < b.frequency_hz;
    });
    for (std::size_t i = 0; i < count; ++i) {
      INFO("mode " << i << ": " << body.modes[i].frequency_hz << " Hz");
      CHECK(std::fabs(found.modes[i].frequency_hz - body.modes[i].frequency_hz) < 1e-6);
      const double weight = found.displacement(i, 0) * found.displacement(i, 0);
      const double wanted =
          body.modes[i].displacement[0] * body.modes[i].displacement[0] / body.mass;
      CHECK(std::fabs(weight - wanted) < 1e-9);
      CHECK(std::fabs(found.modes[i].t60_s / body.modes[i].t60_s - 1.0) < 0.01);
    }
  }
}

TEST_CASE("impossible chains report the reason", "[tune_modes]") {
  const PlacedModes body{.places = {"rim", "crown"},
                         .modes = {{100.0, 1.0, {1.0, 0.0}}, {100.0, 1.0, {1.0, 0.0}}}};
  CHECK(chain_of(body, "rom").error().message == "there is no place 'rom'; there are rim, crown");
  CHECK(chain_of(body, "crown").error().message == "no mode moves the place 'crown'");
  CHECK(chain_of(body, "rim").error().message.find("the same frequency") != std::string::npos);
}

}  // namespace ressort::tune_modes_test
