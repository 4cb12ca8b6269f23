// Timbre that is asked for: hidden parameters are found again, as the textbook simulator renders
// them; and what cannot be had says so.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>

#include "core/analysis/timbre/ask.h"
#include "core/analysis/timbre/frame_analysis.h"
#include "tests/support/harness.h"
#include "tests/support/random.h"
#include "tests/support/reference_network.h"

namespace ressort {
namespace {

constexpr double rate_hz = 44100.0;
constexpr std::size_t frame = 2048;

struct Ranged {
  double minimum;
  double maximum;
};

// A linear model, and where its parameters may be.
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

// The first frame after a blow, as the textbook simulator has it.
std::vector<double> rendered(const Network& network, std::span<const double> parameters) {
  auto simulation = reference::Builder(network, parameters).build();
  std::vector<double> samples;
  for (std::size_t n = 0; n < frame; ++n) {
    const double force[] = {n == 0 ? 1.0 : 0.0};
    samples.push_back(simulation.simulator.step(force)[0]);
  }
  return samples;
}

// What that frame is like; f0 and T60 are not to be read off 46 ms, so they are the modes' own.
AskedValues heard(const Played& model, std::span<const double> parameters) {
  const Network network = read(model);
  const auto told = StruckModel(network, {}).figures(parameters);
  REQUIRE(told);
  AskedValues values = *told;
  FrameAnalysis analysis({.rate_hz = rate_hz,
                          .size = frame,
                          .f0_hz = values[static_cast<std::size_t>(AskedFigure::f0)]});
  const FrameTimbre timbre = analysis.next(rendered(network, parameters));
  const auto set = [&](AskedFigure figure, std::optional<double> value) {
    values[static_cast<std::size_t>(figure)] = value;
  };
  set(AskedFigure::centroid, timbre.shape->centroid_hz);
  set(AskedFigure::spread, timbre.shape->spread_hz);
  set(AskedFigure::inharmonicity, timbre.harmonics->inharmonicity);
  set(AskedFigure::odd_to_even, timbre.harmonics->odd_to_even);
  return values;
}

Result<AskedTimbre> asked(const Played& model, std::span<const double> start,
                          std::span<const TimbreTarget> targets) {
  const Network network = read(model);
  const StruckModel lines(network, {});
  const StruckModel samples(network, {.by_samples = true});
  const std::vector<FreeParameter> free = free_of(model);
  return ask_timbre([&](auto parameters) { return lines.figures(parameters); }, start, free,
                    targets,
                    {.exactly = [&](auto parameters) { return samples.figures(parameters); }});
}

}  // namespace

TEST_CASE("figures by samples are those of the sound", "[ask]") {
  support::Random random(5);
  for (const Played& model : models) {
    INFO(model.text);
    std::vector<double> parameters;
    for (const Ranged& range : model.ranges) {
      parameters.push_back(drawn(random, range));
    }
    const auto told = StruckModel(read(model), {.by_samples = true}).figures(parameters);
    REQUIRE(told);
    const AskedValues sound = heard(model, parameters);
    for (const AskedFigureRow& row : asked_figure_rows()) {
      INFO(row.name);
      const auto index = static_cast<std::size_t>(row.figure);
      REQUIRE((*told)[index].has_value() == sound[index].has_value());
      if (sound[index]) {
        CHECK(*(*told)[index] == Approx(*sound[index]).epsilon(1e-6).margin(1e-9));
      }
    }
  }
}

TEST_CASE("hidden parameters' timbre is found again, 20 of 20", "[ask]") {
  constexpr int seeds = 20;
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
    const AskedValues wanted = heard(model, hidden);
    std::vector<TimbreTarget> targets;
    for (const AskedFigureRow& row : asked_figure_rows()) {
      if (const auto value = wanted[static_cast<std::size_t>(row.figure)]) {
        targets.push_back({row.figure, *value});
      }
    }
    const auto clock = std::chrono::steady_clock::now();
    const auto asked_for = asked(model, start, targets);
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - clock;
    REQUIRE(asked_for);
    const AskedValues sound = heard(model, asked_for->values);
    double off = 0.0;
    for (const TimbreTarget& target : targets) {
      const auto value = sound[static_cast<std::size_t>(target.figure)];
      REQUIRE(value);
      off = std::max(off, std::fabs(noticed_between(target.figure, *value, target.value)));
    }
    found += off <= 0.1 ? 1 : 0;
    worst = std::max(worst, off);
    if (off > 0.1) for (std::size_t t = 0; t < targets.size(); ++t) std::printf("%s wants %g has %g noticed %g by %g\n", row_of(targets[t].figure).name.data(), targets[t].value, *sound[(std::size_t)targets[t].figure], asked_for->noticed[t], noticed_between(targets[t].figure, *sound[(std::size_t)targets[t].figure], targets[t].value));
    if (off > 0.1) for (std::size_t i = 0; i < hidden.size(); ++i) std::printf("hidden %g start %g found %g\n", hidden[i], start[i], asked_for->values[i]);
    std::printf("seed %2d: %.4f JND off, %d starts, %zu trials, %.2f s\n", seed, off,
                asked_for->starts, asked_for->trials, took.count());
  }
  std::printf("%d of %d returned within a tenth of what is noticed, the worst %.4f off\n", found,
              seeds, worst);
  CHECK(found == seeds);
}

}  // namespace ressort
