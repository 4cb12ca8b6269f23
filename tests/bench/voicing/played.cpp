#include "tests/bench/voicing/played.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <stdexcept>

#include "tests/bench/voicing/player.h"

namespace ressort::voicing {
namespace {

constexpr double played_rate_hz = 48000.0;
constexpr double played_s = 1.0;
constexpr double between_strikes_s = 0.1;

std::vector<TimedEvent> restruck(const std::vector<TimedEvent>& once) {
  std::vector<TimedEvent> events;
  for (double at_s = 0.0; at_s < played_s; at_s += between_strikes_s) {
    for (TimedEvent timed : once) {
      timed.time_s = at_s;
      events.push_back(timed);
    }
  }
  return events;
}

double median(std::vector<double> numbers) {
  const auto middle = numbers.begin() + static_cast<std::ptrdiff_t>(numbers.size() / 2);
  std::nth_element(numbers.begin(), middle, numbers.end());
  return *middle;
}

}  // namespace

int print_played(const std::vector<std::string>& names, int turns) {
  std::printf(
      "| %% of a core | voices | idle | one | all | re-struck | low keys | high keys |\n"
      "| --- | --- | --- | --- | --- | --- | --- | --- |\n");
  int failures = 0;
  for (const std::string& name : names) {
    try {
      Player player(name, played_rate_hz);
      const int voices = player.instrument().voices;
      const std::vector<TimedEvent> all = chord(voices);
      const std::array<std::vector<TimedEvent>, 6> played = {
          {{},
           chord(1, 60, 1),
           all,
           restruck(all),
           chord(voices, 28, 1),
           chord(voices, std::max(28, 97 - voices), 1)}};
      std::array<std::vector<double>, played.size()> shares;
      for (int turn = 0; turn < turns; ++turn) {
        for (std::size_t i = 0; i < played.size(); ++i) {
          shares[i].push_back(player.processor_share(played[i], played_s));
        }
      }
      std::printf("| %s | %d ", name.c_str(), voices);
      for (const std::vector<double>& share : shares) {
        std::printf("| %.2f ", 100.0 * median(share));
      }
      std::printf("|\n");
      std::fflush(stdout);
    } catch (const std::runtime_error& error) {
      std::fprintf(stderr, "%s\n", error.what());
      ++failures;
    }
  }
  return failures;
}

}  // namespace ressort::voicing
