#include "app/commands/chart/clock.h"

#include <sched.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <numeric>

namespace ressort::commands {
namespace {

constexpr double lengths_s[] = {1.0, 0.3, 0.1, 0.03};
constexpr std::size_t stretch = 441;  // output samples
constexpr int least_rounds = 3;
constexpr int most_rounds = 100;

double cpu_ns() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e9 * static_cast<double>(now.tv_sec) + static_cast<double>(now.tv_nsec);
}

// What one way took.
struct Times {
  std::vector<double> fastest;  // [stretch]
  std::vector<double> rounds;   // [round] all stretches of it

  double ns() const { return std::accumulate(fastest.begin(), fastest.end(), 0.0); }
  double upper_ns() const {
    std::vector<double> sorted = rounds;
    std::sort(sorted.begin(), sorted.end());
    return sorted.empty() ? ns() : sorted[3 * (sorted.size() - 1) / 4];
  }
};

// Plays the sound once.
void play_round(MadeWay& way, Times& times) {
  way.player->rewind();
  double sum = 0.0;
  for (double& kept : times.fastest) {
    const double start = cpu_ns();
    way.player->play(stretch * way.way.oversampling, nullptr);
    const double spent = cpu_ns() - start;
    kept = std::min(kept, spent);
    sum += spent;
  }
  times.rounds.push_back(sum);
}

// All ways once.
double round_ns(std::vector<MadeWay>& ways, std::vector<Times>& times,
                const std::function<bool()>& stops) {
  const double start = cpu_ns();
  for (std::size_t i = 0; i < ways.size() && !stops(); ++i) {
    play_round(ways[i], times[i]);
  }
  return cpu_ns() - start;
}

}  // namespace

Timing time_ways(std::vector<MadeWay>& ways, double patience_s,
                 const std::function<bool()>& stops) {
  Timing timing;
  std::vector<Times> times(ways.size());
  const auto shorten = [&](double seconds) {
    timing.seconds = seconds;
    const double frames = seconds * Network::reference_rate_hz;
    for (Times& kept : times) {
      kept.fastest.assign(static_cast<std::size_t>(frames) / stretch, HUGE_VAL);
      kept.rounds.clear();
    }
  };
  shorten(lengths_s[std::size(lengths_s) - 1]);
  const double short_ns = round_ns(ways, times, stops);
  for (const double seconds : lengths_s) {
    if (seconds == lengths_s[std::size(lengths_s) - 1] ||
        least_rounds * short_ns * seconds / timing.seconds < 1e9 * patience_s) {
      shorten(seconds);
      break;
    }
  }
  double spent = 0.0;
  while (!stops() && timing.rounds < most_rounds &&
         (timing.rounds < least_rounds || spent < 1e9 * patience_s)) {
    spent += round_ns(ways, times, stops);
    ++timing.rounds;
  }
  for (const Times& kept : times) {
    const auto frames = static_cast<double>(kept.fastest.size() * stretch);
    timing.ns.push_back(kept.ns() / frames);
    timing.upper_ns.push_back(kept.upper_ns() / frames);
  }
  return timing;
}

void stay_on_one_core() {
  cpu_set_t cores;
  CPU_ZERO(&cores);
  CPU_SET(static_cast<std::size_t>(std::max(0, sched_getcpu())), &cores);
  sched_setaffinity(0, sizeof cores, &cores);
}

}  // namespace ressort::commands
