#include "tests/bench/voicing/tuner.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

namespace ressort::voicing {
namespace {

constexpr int lowest_key = 36;
constexpr int highest_key = 96;
constexpr double most_deviation_cents = 5.0;
constexpr double start_s = 0.1;
constexpr double silence_db = -60.0;

struct Reading {
  int key = 0;
  bool is_heard = false;
  double yin_cents = 0.0;  // relative to the key
  double partials_cents = 0.0;
};

Reading read(Player& player, int key) {
  Reading reading{.key = key};
  const double hz = 440.0 * std::exp2((key + player.instrument().transpose - 69) / 12.0);
  const double seconds = std::max(0.4, 24.0 / hz);
  const Stereo sound =
      player.play({{0.0, note_on(key, 100)}}, start_s + seconds).part(start_s, 9.0);
  reading.is_heard = decibels(peak_of(sound)) > silence_db;
  if (reading.is_heard) {
    reading.yin_cents = cents(yin_hz(sound, hz / 3.0, 3.0 * hz), hz);
    reading.partials_cents = partials_cents(sound, hz);
  }
  return reading;
}

}  // namespace

int check_semitones(Player& player, const std::string& name) {
  if (!player.scene().preset.keyboard || !player.instrument().mode) {
    return 0;
  }
  std::vector<Reading> readings;
  for (int key = lowest_key; key <= highest_key; ++key) {
    const Reading reading = read(player, key);
    if (reading.is_heard) {
      readings.push_back(reading);
    }
  }
  const auto is_off = [&](std::size_t i) {
    return i > 0 &&
           std::fabs(readings[i].yin_cents - readings[i - 1].yin_cents) > most_deviation_cents;
  };
  int off = 0;
  double worst = 0.0;
  for (std::size_t i = 0; i < readings.size(); ++i) {
    off += is_off(i) ? 1 : 0;
    worst = i > 0 ? std::max(worst, std::fabs(readings[i].yin_cents - readings[i - 1].yin_cents))
                  : worst;
    if (is_off(i)) {
      std::printf("  %s key %d: YIN %+.1f cents, partials %+.1f cents%s\n", name.c_str(),
                  readings[i].key, readings[i].yin_cents, readings[i].partials_cents,
                  is_off(i) ? " !" : "");
    }
  }
  std::printf("%s: %d of %zu semitones off by more than %g cents, the worst by %.1f\n",
              name.c_str(), off, readings.size(), most_deviation_cents, worst);
  std::fflush(stdout);
  return off;
}

}  // namespace ressort::voicing
