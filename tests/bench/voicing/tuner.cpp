#include "tests/bench/voicing/tuner.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string>
#include <vector>

namespace ressort::voicing {
namespace {

constexpr int lowest_key = 21;
constexpr int highest_key = 108;
constexpr double most_step_cents = 5.0;
constexpr double most_partials_cents = 3.0;
// A reading starts when a bow has caught the string and a curved bridge has let it go, or earlier
// if the sound is too short.
constexpr double late_s = 0.5;
constexpr double early_s = 0.1;
constexpr double short_db = -30.0;  // fall from the early to the late start

struct Reading {
  int key = 0;
  double whole_cents = 0.0;      // YIN of the sound, relative to the key
  double strongest_cents = 0.0;  // YIN of the strongest partial alone
  PartialsPitch partials;
  double step_cents = 0.0;  // deviation from a semitone above the last key
  bool is_off() const {
    return std::fabs(step_cents) > most_step_cents ||
           std::fabs(partials.cents) > most_partials_cents;
  }
};

// Empty if the key is silent.
std::optional<Reading> read(Player& player, int key) {
  const double hz = 440.0 * std::exp2((key + player.instrument().transpose - 69) / 12.0);
  const double seconds = std::max(1.5, 48.0 / hz);  // two strings may beat for so long
  const Stereo all = player.play({{0.0, note_on(key, 100)}}, late_s + seconds + 4.0 / hz);
  const auto level_at = [&](double from_s) {
    return decibels(peak_of(all.part(from_s, from_s + 0.1)));
  };
  if (level_at(early_s) <= silence_db) {
    return std::nullopt;
  }
  const bool is_short = level_at(late_s) < level_at(early_s) + short_db;
  const double from_s = is_short ? early_s : late_s;
  const double to_s = from_s + (is_short ? std::max(0.4, 24.0 / hz) : seconds);
  const Stereo sound = all.part(from_s, to_s);
  const PartialsPitch partials = partials_pitch(sound, hz);
  // The band around the strongest partial leaves its neighbours 5 standard deviations away.
  const int n = partials.strongest;
  const Stereo band = band_around(all, n * hz, 0.2 / n).part(from_s, to_s);
  return Reading{.key = key,
                 .whole_cents = cents(yin_hz(sound, hz / 1.5, hz * 1.5), hz),
                 .strongest_cents = cents(yin_hz(band, n * hz / 1.5, n * hz * 1.5), n * hz) -
                                    stretch_cents(n, partials.stiffness),
                 .partials = partials};
}

// YIN of a whole sound weights partial n by n^2, so that a stiff string or a bar misleads it. The
// single partials of a sitar exchange energy and drift. A mistuned key moves both readings.
double smaller_step(const Reading& from, const Reading& to) {
  const double whole = to.whole_cents - from.whole_cents;
  const double strongest = to.strongest_cents - from.strongest_cents;
  return std::fabs(whole) < std::fabs(strongest) ? whole : strongest;
}

}  // namespace

int check_semitones(Player& player, const std::string& name) {
  if (!player.scene().preset.keyboard || !player.instrument().mode) {
    return 0;
  }
  int keys = 0;
  int off = 0;
  double worst_step = 0.0;
  double worst_partials = 0.0;
  std::string stretch;  // inharmonicity at every octave
  std::optional<Reading> last;
  for (int key = lowest_key; key <= highest_key; ++key) {
    std::optional<Reading> reading = read(player, key);
    if (!reading) {
      continue;
    }
    if (last) {
      reading->step_cents = smaller_step(*last, *reading);
    }
    ++keys;
    if (key % 12 == 0) {
      char octave[32];
      std::snprintf(octave, sizeof octave, " %d: %.1e", key, reading->partials.stiffness);
      stretch += octave;
    }
    worst_step = std::max(worst_step, std::fabs(reading->step_cents));
    worst_partials = std::max(worst_partials, std::fabs(reading->partials.cents));
    if (reading->is_off()) {
      ++off;
      std::printf(
          "  %s key %d: YIN %+.1f cents, of partial %d %+.1f, step %+.1f, partials %+.1f "
          "(B %.1e)\n",
          name.c_str(), key, reading->whole_cents, reading->partials.strongest,
          reading->strongest_cents, reading->step_cents, reading->partials.cents,
          reading->partials.stiffness);
    }
    last = reading;
  }
  std::printf("%s: %d of %d keys off, the worst step by %.1f cents, the worst partials by %.1f\n",
              name.c_str(), off, keys, worst_step, worst_partials);
  std::printf("  B by key:%s\n", stretch.c_str());
  std::fflush(stdout);
  return off;
}

}  // namespace ressort::voicing
