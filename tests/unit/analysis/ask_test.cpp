// Target timbres: hidden parameters are found from renders of the reference simulator, and
// unreachable targets are reported.
#include <cmath>
#include <cstdio>
#include <ctime>
#include <limits>
#include <numbers>

#include "core/analysis/timbre/ask.h"
#include "core/analysis/timbre/envelope.h"
#include "core/analysis/timbre/frame_analysis.h"
#include "tests/support/harness.h"
#include "tests/support/networks/reference_network.h"
#include "tests/support/random.h"
#include "tests/support/thorough.h"

namespace ressort::ask_test {
namespace {

constexpr double rate_hz = 44100.0;
constexpr std::size_t frame = 2048;
constexpr std::size_t sound_samples = 22050;  // Length for the attack.

struct Ranged {
  double minimum;
  double maximum;
};

// A linear model and the ranges of its parameters.
struct Played {
  const char* text;
  std::vector<Ranged> ranges;
};

const Played models[] = {
    {"@k param 0.2\n@z param 0.001\n@at param 0.3\n@s string 40 1. k z 0. 0.\n"
     "@in1 frcInput [@s at]\n@out1 posOutput [@s 0.71]\n",
     {{0.02, 0.9}, {1e-4, 0.02}, {0.05, 0.45}}},
    {"@k param 0.2\n@bend param 0.02\n@z param 0.001\n@s stiffString 30 1. k bend z 0. 0.\n"
     "@in1 frcInput [@s 0.21]\n@out1 posOutput [@s 0.66]\n",
     {{0.05, 0.5}, {1e-3, 0.1}, {1e-4, 0.01}}},
    {"@m param 1\n@k param 0.1\n@z param 0.001\n@at param 0.3\n@s closedMesh 7 9 m k z 0. 0.\n"
     "@in1 frcInput [@s at 0.3]\n@out1 posOutput [@s 0.7 0.6]\n",
     {{1.0, 8.0}, {0.02, 0.2}, {1e-4, 0.01}, {0.2, 0.5}}},
    {"@k param 0.05\n@z param 0.001\n@air param 0.0005\n@a mass 1. 0. 0.\n@b mass 1.5 0. 0.\n"
     "@c mass 0.8 0. 0.\n@g ground 0.\n@l0 springDamper @g @a k air\n@l1 springDamper @a @b 0.05 "
     "z\n"
     "@l2 springDamper @b @c k z\n@in1 frcInput @a\n@out1 posOutput @c\n",
     {{0.005, 0.3}, {1e-5, 0.01}, {1e-5, 0.01}}},
};

Network read(const Played& model) {
  return support::network_of(model.text);
}

std::vector<FreeParameter> free_of(const Played& model) {
  std::vector<FreeParameter> free;
  for (std::size_t i = 0; i < model.ranges.size(); ++i) {
    free.push_back({i, model.ranges[i].minimum, model.ranges[i].maximum});
  }
  return free;
}

double drawn(support::Random& random, const Ranged& range) {
  return is_wide(range.minimum, range.maximum)
             ? range.minimum * std::pow(range.maximum / range.minimum, random.uniform(0.0, 1.0))
             : random.uniform(range.minimum, range.maximum);
}

// The response to a strike in the reference simulator.
std::vector<double> rendered(const Network& network, std::span<const double> parameters,
                             std::size_t count) {
  auto simulation = reference::make_simulation(network, parameters);
  std::vector<double> samples;
  for (std::size_t n = 0; n < count; ++n) {
    const double force[] = {n == 0 ? 1.0 : 0.0};
    samples.push_back(simulation.simulator.step(force)[0]);
  }
  return samples;
}

std::optional<double> attack_ms(std::span<const double> samples) {
  std::vector<double> levels;
  Envelope envelope(rate_hz, [&](double level) { levels.push_back(level); });
  envelope.add(samples);
  envelope.end();
  const auto shape = temporal_shape(levels, rate_hz);
  return shape ? std::optional(1e3 * std::pow(10.0, shape->log_attack_time)) : std::nullopt;
}

// The descriptors of that sound. Its first 46 ms do not determine f0 and T60, so those are taken
// from the modes.
TargetValues heard(const Played& model, std::span<const double> parameters) {
  const Network network = read(model);
  const auto told = StruckModel(network, {}).figures(parameters, StruckAs::lines);
  REQUIRE(told);
  TargetValues values = *told;
  FrameAnalysis analysis({.rate_hz = rate_hz,
                          .size = frame,
                          .f0_hz = values[static_cast<std::size_t>(TargetFigure::f0)]});
  const std::vector<double> sound = rendered(network, parameters, sound_samples);
  const FrameTimbre timbre = analysis.next(std::span(sound).first(frame));
  const auto set = [&](TargetFigure figure, std::optional<double> value) {
    values[static_cast<std::size_t>(figure)] = value;
  };
  set(TargetFigure::centroid, timbre.shape->centroid_hz);
  set(TargetFigure::spread, timbre.shape->spread_hz);
  set(TargetFigure::rolloff, timbre.shape->rolloff95_hz);
  set(TargetFigure::skewness, timbre.shape->skewness);
  set(TargetFigure::kurtosis, timbre.shape->kurtosis);
  set(TargetFigure::slope, timbre.shape->slope);
  set(TargetFigure::inharmonicity, timbre.harmonics->inharmonicity);
  set(TargetFigure::odd_to_even, timbre.harmonics->odd_to_even);
  set(TargetFigure::attack, attack_ms(sound));
  return values;
}

Result<FoundTimbre> asked(const Played& model, std::span<const double> start,
                          std::span<const TimbreTarget> targets) {
  const Network network = read(model);
  StruckModel struck(network, {.has_attack = true});
  return find_timbre(timbre_model(struck, StruckAs::lines), start, free_of(model), targets,
                     {.exactly = timbre_model(struck, StruckAs::samples)});
}

}  // namespace

TEST_CASE("figures computed from samples equal those of the sound", "[ask]") {
  support::Random random(5);
  for (const Played& model : models) {
    INFO(model.text);
    std::vector<double> parameters;
    for (const Ranged& range : model.ranges) {
      parameters.push_back(drawn(random, range));
    }
    const auto told =
        StruckModel(read(model), {.has_attack = true}).figures(parameters, StruckAs::samples);
    REQUIRE(told);
    const TargetValues sound = heard(model, parameters);
    for (const TargetFigureRow& row : target_figure_rows()) {
      INFO(row.name);
      const auto index = static_cast<std::size_t>(row.figure);
      REQUIRE((*told)[index].has_value() == sound[index].has_value());
      if (sound[index]) {
        CHECK(*(*told)[index] == Approx(*sound[index]).epsilon(1e-6).margin(1e-9));
      }
    }
  }
}

TEST_CASE("the timbre of hidden parameters is always found", "[ask]") {
  const int seeds = support::of_all(5, 20);
  int found = 0;
  double worst = 0.0;
  for (int seed = 0; seed < seeds; ++seed) {
    const Played& model = models[static_cast<std::size_t>(seed) % std::size(models)];
    support::Random random(1000 + static_cast<std::uint64_t>(seed));
    std::vector<double> hidden;
    std::vector<double> start;
    for (const Ranged& range : model.ranges) {
      hidden.push_back(drawn(random, range));
      start.push_back(drawn(random, range));
    }
    const TargetValues wanted = heard(model, hidden);
    std::vector<TimbreTarget> targets;
    for (const TargetFigureRow& row : target_figure_rows()) {
      if (const auto value = wanted[static_cast<std::size_t>(row.figure)]) {
        targets.push_back({row.figure, *value});
      }
    }
    const std::clock_t before = std::clock();
    const auto asked_for = asked(model, start, targets);
    const double took_s = static_cast<double>(std::clock() - before) / CLOCKS_PER_SEC;
    REQUIRE(asked_for);
    const TargetValues sound = heard(model, asked_for->values);
    double off = 0.0;
    for (const TimbreTarget& target : targets) {
      const auto value = sound[static_cast<std::size_t>(target.figure)];
      REQUIRE(value);
      off = std::max(off, std::fabs(jnd_between(target.figure, *value, target.value)));
    }
    found += off <= 0.1 ? 1 : 0;
    worst = std::max(worst, off);
    std::printf("seed %2d: %.4f JND off, %d starts, %zu trials, %.2f s of CPU\n", seed, off,
                asked_for->starts, asked_for->trials, took_s);
  }
  std::printf("%d of %d results within 0.1 JND of the target, the worst %.4f JND off\n", found,
              seeds, worst);
  CHECK(found == seeds);
}

// Two equal masses, struck at one and heard at the other: the energy crosses in half a beat of
// their two modes, which the spring between them separates.
const Played beating{
    "@k param 0.002\n@c param 0.00002\n@z param 0.0005\n@g ground 0.\n@a mass 1. 0. 0.\n"
    "@b mass 1. 0. 0.\n@l0 springDamper @g @a k z\n@l1 springDamper @g @b k z\n"
    "@l2 spring @a @b c\n@in1 frcInput @a\n@out1 posOutput @b\n",
    {{0.001, 0.004}, {0.000005, 0.0002}, {0.0001, 0.002}}};

TEST_CASE("a requested attack is reached in the sound", "[ask]") {
  const auto index = static_cast<std::size_t>(TargetFigure::attack);
  support::Random random(15);
  for (int round = 0; round < 5; ++round) {
    std::vector<double> hidden;
    std::vector<double> start;
    for (const Ranged& range : beating.ranges) {
      hidden.push_back(drawn(random, range));
      start.push_back(drawn(random, range));
    }
    const double wanted_ms = *heard(beating, hidden)[index];
    const TimbreTarget targets[] = {{TargetFigure::attack, wanted_ms}};
    const auto found = asked(beating, start, targets);
    REQUIRE(found);
    CHECK(found->is_reached);
    const double reached_ms = *heard(beating, found->values)[index];
    INFO(wanted_ms << " ms, " << reached_ms << " ms");
    CHECK(std::fabs(jnd_between(TargetFigure::attack, reached_ms, wanted_ms)) < 0.1);
  }
  // The slowest attack has the weakest spring between them and the least loss.
  const TimbreTarget slow[] = {{TargetFigure::attack, 10000.0}};
  const auto slowest = asked(beating, std::vector<double>{0.002, 0.00002, 0.0005}, slow);
  REQUIRE(slowest);
  CHECK_FALSE(slowest->is_reached);
  CHECK(slowest->noticed[0] < -1.0);
  REQUIRE_FALSE(slowest->held.empty());
  CHECK(slowest->values[1] == Approx(0.000005));
  CHECK(slowest->values[2] == Approx(0.0001));
}

TEST_CASE("unreachable targets are reported with the bound that limits them", "[ask]") {
  const Played& model = models[0];
  const std::vector<double> start{0.2, 0.001, 0.3};
  // f = rate / pi asin(sqrt(K/M) sin(pi / 2 / (N + 1))), by hand: 40 masses, of which 38 move.
  const double highest_hz =
      rate_hz / std::numbers::pi * std::asin(std::sqrt(0.9) * std::sin(std::numbers::pi / 78.0));
  const TimbreTarget high[] = {{TargetFigure::f0, 5000.0}};
  const auto top = asked(model, start, high);
  REQUIRE(top);
  CHECK_FALSE(top->is_reached);
  CHECK(top->values[0] == 0.9);
  CHECK(*top->reached[static_cast<std::size_t>(TargetFigure::f0)] ==
        Approx(highest_hz).epsilon(1e-4));  // Z shifts the frequency a little.
  REQUIRE_FALSE(top->held.empty());
  CHECK(top->held[0].index == 0);
  CHECK(top->held[0].is_highest);
  CHECK(top->noticed[0] < -100.0);

  // T60 = 13.8155 / (rate zeta), zeta = Z/M (2 sin(pi / 2 / (N + 1)))^2: the longest has Z at its
  // lowest, for any K.
  const double zeta = 1e-4 * std::pow(2.0 * std::sin(std::numbers::pi / 78.0), 2.0);
  const TimbreTarget long_one[] = {{TargetFigure::t60, 1e300}};
  const auto longest = asked(model, start, long_one);
  REQUIRE(longest);
  CHECK(longest->values[1] == 1e-4);
  CHECK(*longest->reached[static_cast<std::size_t>(TargetFigure::t60)] ==
        Approx(-3.0 * std::log(10.0) / (rate_hz * 0.5 * std::log1p(-zeta))).epsilon(1e-6));
}

TEST_CASE("invalid figures and models without free parameters are rejected", "[ask]") {
  const Played& model = models[0];
  const std::vector<double> start{0.2, 0.001, 0.3};
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  constexpr double endless = std::numeric_limits<double>::infinity();
  for (const TargetFigureRow& row : target_figure_rows()) {
    INFO(row.name);
    for (const double wrong : {-1.0, nan, endless, -endless}) {
      if (wrong == -1.0 && row.is_signed) {
        continue;
      }
      const TimbreTarget targets[] = {{row.figure, wrong}};
      CHECK_FALSE(asked(model, start, targets));
    }
    {
      const TimbreTarget targets[] = {{row.figure, row.is_signed ? 1e100 : 1e300}};
      const auto nearest = asked(model, start, targets);
      REQUIRE(nearest);
      CHECK(std::isfinite(nearest->noticed[0]));
      for (std::size_t i = 0; i < start.size(); ++i) {
        CHECK(nearest->values[i] >= model.ranges[i].minimum);
        CHECK(nearest->values[i] <= model.ranges[i].maximum);
      }
    }
  }
  const TimbreTarget zero[] = {{TargetFigure::centroid, 0.0}};
  CHECK_FALSE(asked(model, start, zero));
  const TimbreTarget harmonic[] = {{TargetFigure::inharmonicity, 0.0}};
  CHECK(asked(model, start, harmonic));
  const FiguresAt any = [](std::span<const double>) { return TargetValues{1.0, 1.0, 1.0}; };
  const TimbreTarget bright[] = {{TargetFigure::centroid, 2.0}};
  CHECK(find_timbre({any}, start, {}, bright, {}).error().message ==
        "no parameter is free to change");
  const FreeParameter one[] = {{0, 0.1, 0.3}};
  CHECK(find_timbre({any}, start, one, {}, {}).error().message == "no target is given");
  // A parameter without influence keeps its value, and the result says so.
  const auto idle = find_timbre({any}, start, one, bright, {});
  REQUIRE(idle);
  CHECK_FALSE(idle->has_influence);
  CHECK(idle->values == start);
  const TimbreTarget hollow[] = {{TargetFigure::odd_to_even, 2.0}};
  CHECK(find_timbre({any}, start, one, hollow, {}).error().message ==
        "the sound has no odd_to_even there");
}

TEST_CASE("a search handles silence, unstable corners and cancellation", "[ask]") {
  // The output is at a mass without a spring.
  const Played silent{
      "@k param 0.1\n@g ground 0.\n@a mass 1. 0. 0.\n@b mass 1. 0. 0.\n"
      "@s spring @g @a k\n@in1 frcInput @a\n@out1 posOutput @b\n",
      {{0.01, 0.5}}};
  const TimbreTarget bright[] = {{TargetFigure::centroid, 500.0}};
  const auto nothing = asked(silent, std::vector<double>{0.1}, bright);
  REQUIRE_FALSE(nothing);
  CHECK(nothing.error().message.find("the output is silent") != std::string::npos);

  // Above K = 4 M the model is unstable: the search avoids that.
  const Played corner{
      "@k param 0.1\n@z param 0.001\n@g ground 0.\n@a mass 1. 0. 0.\n"
      "@s springDamper @g @a k z\n@in1 frcInput @a\n@out1 posOutput @a\n",
      {{0.001, 40.0}, {-0.01, 0.01}}};
  const TimbreTarget tone[] = {{TargetFigure::f0, 3000.0}, {TargetFigure::t60, 0.5}};
  const auto found = asked(corner, std::vector<double>{20.0, -0.005}, tone);
  REQUIRE(found);
  CHECK(found->is_reached);
  // By hand: T60 = 0.5 s is zeta = 1 - 10^(-6 / (rate T60)), and lambda = 1 + r^2 - 2 r cos theta.
  const double r = std::pow(10.0, -3.0 / (rate_hz * 0.5));
  const double theta = 2.0 * std::numbers::pi * 3000.0 / rate_hz;
  CHECK(found->values[1] == Approx(1.0 - r * r).epsilon(1e-3));
  CHECK(found->values[0] == Approx(1.0 + r * r - 2.0 * r * std::cos(theta)).epsilon(1e-3));

  const FiguresAt any = [](std::span<const double>) { return TargetValues{1.0, 1.0, 1.0}; };
  const FreeParameter one[] = {{0, 0.1, 0.3}};
  const auto stopped_one =
      find_timbre({any}, std::vector<double>{0.2}, one, bright,
                  {.progress = Progress([](std::string_view) { return false; })});
  REQUIRE_FALSE(stopped_one);
  CHECK(stopped_one.error().message == stopped);
}

TEST_CASE("a key's pitch stays constant while the timbre changes", "[ask]") {
  const Network network = read(models[1]);
  const FreeParameter free[] = {{0, 0.05, 0.5}, {1, 1e-3, 0.1}, {2, 1e-4, 0.01}};
  StruckModel keyed(network, {.key_hz = 220.0});
  const TimbreTarget targets[] = {{TargetFigure::inharmonicity, 0.01}, {TargetFigure::t60, 3.0}};
  const auto found = find_timbre(timbre_model(keyed, StruckAs::lines),
                                 std::vector<double>{0.2, 0.02, 0.001}, free, targets, {});
  REQUIRE(found);
  const double cents =
      1200.0 * std::log2(*found->reached[static_cast<std::size_t>(TargetFigure::f0)] / 220.0);
  CHECK(std::fabs(cents) < 1e-5);
}

TEST_CASE("a key scales springs at places of a string", "[ask]") {
  const Network network = support::network_of(
      "@z param 0.001\n@s chain 12 1. 0.2 z 0. 0.\n@g ground 0.\n@foot spring @g [@s 0.3] 0.05\n"
      "@in1 frcInput [@s 0.3]\n@out1 posOutput [@s 0.9]\n");
  StruckModel model(network, {.key_hz = 220.0});
  const auto told = model.figures(parameter_values(network), StruckAs::lines);
  REQUIRE(told);
  CHECK(*(*told)[static_cast<std::size_t>(TargetFigure::f0)] == Approx(220.0).epsilon(1e-8));
}

// A raised cosine of 2 ms is a low-pass filter; the output is the mean of two channels.
TEST_CASE("a longer strike is darker, like the sound of the same pulse", "[ask]") {
  const Network network = support::network_of(
      "@k param 0.2\n@s string 40 1. k 0.001 0. 0.\n@in1 frcInput [@s 0.23]\n"
      "@out1 posOutput [@s 0.71]\n@out2 posOutput [@s 0.4]\n");
  const std::vector<double> values = parameter_values(network);
  constexpr int length = 88;
  auto simulation = reference::make_simulation(network, values);
  std::vector<double> samples;
  for (std::size_t n = 0; n < frame; ++n) {
    const double turn = 2.0 * std::numbers::pi * (static_cast<double>(n) + 0.5) / length;
    const double force[] = {n < length ? (1.0 - std::cos(turn)) / length : 0.0};
    const auto heard_there = simulation.simulator.step(force);
    samples.push_back(0.5 * (heard_there[0] + heard_there[1]));
  }
  FrameAnalysis analysis({.rate_hz = rate_hz, .size = frame});
  const SpectralShape sound = *analysis.next(samples).shape;
  const auto told = [&](double length_s, StruckAs how) {
    const auto values_there =
        StruckModel(network, {.blows = {{.length_s = length_s}}}).figures(values, how);
    REQUIRE(values_there);
    return *(*values_there)[static_cast<std::size_t>(TargetFigure::centroid)];
  };
  CHECK(told(length / rate_hz, StruckAs::samples) == Approx(sound.centroid_hz).epsilon(1e-6));
  CHECK(told(length / rate_hz, StruckAs::lines) == Approx(sound.centroid_hz).epsilon(0.05));
  CHECK(told(length / rate_hz, StruckAs::samples) < 0.7 * told(0.0, StruckAs::samples));
}

}  // namespace ressort::ask_test
