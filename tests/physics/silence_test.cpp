// Modes omitted by silence= stay below the peak of the full output by the stated decibels, at all
// times, for strikes at inputs and for initial states. Each network is compared with all of its
// modes.
#include <cstdio>

#include "tests/support/player.h"

namespace ressort::silence_test {
namespace {

using support::network_of;
using support::Player;
using support::Random;
using support::show;

// A string or mesh, held and heard at places and at masses, with proportional dampers.
std::string network(std::uint64_t seed) {
  Random random(seed);
  const auto number = [&](double low, double high) { return show(random.uniform(low, high)); };
  const double k = random.uniform(0.02, 0.2);
  const double z = k * std::exp(random.uniform(std::log(0.001), std::log(0.1)));
  const std::string start = random.below(3) == 0 ? number(-0.5, 0.5) : "0.";
  std::string text = "@g ground 0.\n";
  const bool is_mesh = random.below(2) == 0;
  const auto rows = 5 + random.below(6);
  const auto columns = is_mesh ? 5 + random.below(6) : 20 + random.below(60);
  // Written mass by mass, otherwise as a macro connected at places.
  const bool is_written = seed % 2 == 1;
  if (is_written) {
    text += is_mesh ? scenes::square_mesh("s", static_cast<int>(rows), static_cast<int>(columns),
                                          show(k), show(z))
                    : scenes::string("s", static_cast<int>(columns), show(k), show(z));
    if (start != "0." && !is_mesh) {
      const std::string still = "@s_m4 mass s_M 0. 0.";
      text.replace(text.find(still), still.size(), "@s_m4 mass s_M " + start + " 0.");
    }
  } else {
    text += "@s " + (is_mesh ? "mesh " + std::to_string(rows) + " " : std::string("string ")) +
            std::to_string(columns) + " 1. " + show(k) + " " + show(z) + " " + start + " 0.\n";
  }
  const auto place = [&] {
    if (is_written) {
      const std::string column = std::to_string(1 + random.below(columns - 2));
      return is_mesh ? "@s_m" + std::to_string(1 + random.below(rows - 2)) + "_" + column
                     : "@s_m" + column;
    }
    return "[@s " + number(0.05, 0.95) + (is_mesh ? " " + number(0.05, 0.95) : "") + "]";
  };
  if (!is_written || random.below(4) == 0) {
    text += "@l springDamper @g " + place() + " " + show(0.5 * k) + " " + show(0.5 * z) + "\n";
  }
  text += "@in1 frcInput " + place() + "\n@out1 posOutput " + place() + "\n@out2 posOutput " +
          place() + "\n";
  return text;
}

struct Tally {
  std::size_t reduced = 0;  // Networks with sleeping modes.
  double tightest = 0.0;    // Ratio of error to bound.
  double awake = 0.0;       // Share of awake modes.
  std::size_t with_modes = 0;
};

// The largest error of any output, relative to its peak.
void measure(std::uint64_t seed, double silence_db, Tally& tally) {
  const std::string text = network(seed);
  const auto play = [&](double db) {
    Player player(text, default_preset(network_of(text), true),
                  {.bare = true, .budget = Budget{.cents = 1.0, .silence_db = db}});
    constexpr std::size_t frames = 44100;
    std::vector<double> blows(frames, 0.0);
    blows[100] = 1.0;
    if (seed % 4 == 0) {
      blows[20'000] = 0.3;
    }
    const double* const channels[] = {blows.data()};
    double awake = 0.0;
    double modes = 0.0;
    for (std::size_t at = 0; at < frames; at += 630) {
      const double* const here[] = {channels[0] + at};
      player.run(630, {}, {63}, here);
      const EngineMeters meters = player.engine().meters();
      awake += static_cast<double>(meters.modes_awake);
      modes += static_cast<double>(meters.modes);
    }
    return std::tuple(player.out, modes > 0.0 ? awake / modes : -1.0,
                      describe(player.compiled.plan));
  };
  const auto [whole, all, plan] = play(-Budget::unlimited);
  const auto [part, awake, reduced_plan] = play(silence_db);
  INFO("seed " << seed << ", " << silence_db << " dB\n" << text << reduced_plan);
  if (awake >= 0.0) {
    tally.awake += awake;
    ++tally.with_modes;
  }
  bool is_reduced = false;
  for (std::size_t o = 0; o < whole.size(); ++o) {
    const double peak = support::peak(whole[o]);
    double worst = 0.0;
    for (std::size_t n = 0; n < whole[o].size(); ++n) {
      worst = std::max(worst, std::fabs(part[o][n] - whole[o][n]));
    }
    const double bound = std::pow(10.0, silence_db / 20.0) * peak;
    is_reduced = is_reduced || worst > 1e-12 * peak;
    tally.tightest = std::max(tally.tightest, worst / bound);
    CHECK(worst <= bound * (1.0 + 1e-9));
  }
  tally.reduced += is_reduced ? 1 : 0;
}

void measure_all(std::uint64_t first, std::size_t count, std::size_t least_reduced) {
  for (const double silence_db : {-40.0, -60.0, -80.0, -100.0, -120.0}) {
    Tally tally;
    for (std::uint64_t seed = first; seed < first + count; ++seed) {
      measure(seed, silence_db, tally);
    }
    std::printf(
        "silence=%g, seeds %llu to %llu: in %zu something slept, the tightest at %.3f of "
        "its bound, %.1f %% of the modes awake in %zu\n",
        silence_db, static_cast<unsigned long long>(first),
        static_cast<unsigned long long>(first + count - 1), tally.reduced, tally.tightest,
        100.0 * tally.awake / static_cast<double>(std::max<std::size_t>(1, tally.with_modes)),
        tally.with_modes);
    CHECK(tally.reduced >= least_reduced);
    CHECK(tally.tightest >= 0.1);
  }
}

TEST_CASE("omitted modes stay below their stated level", "[silence]") {
  measure_all(1, 12, 3);
}

TEST_CASE("omitted modes stay below their level in 200 networks", "[.][silence_everywhere]") {
  measure_all(1001, 200, 50);
}

}  // namespace
}  // namespace ressort::silence_test
