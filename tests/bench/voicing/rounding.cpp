#include "tests/bench/voicing/rounding.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "tests/bench/voicing/player.h"

namespace ressort::voicing {
namespace {

constexpr double sounding_s = 0.25;
// Rounding a stiffness to 24 bits moves the pitch by up to 5e-5 cents. In this time it turns the
// phase of a partial at 2 kHz by up to 1e-4.
constexpr double most_difference_db = -80.0;

double greatest_difference_db(const Stereo& exact, const Stereo& rounded) {
  double greatest = 0.0;
  for (std::size_t c = 0; c < exact.channels.size(); ++c) {
    for (std::size_t n = 0; n < exact.channels[c].size(); ++n) {
      greatest = std::max(greatest, std::fabs(exact.channels[c][n] - rounded.channels[c][n]));
    }
  }
  return decibels(greatest / std::max(1e-30, peak_of(exact)));
}

}  // namespace

int check_rounding(const std::string& name, double rate_hz) {
  Player exact(name, rate_hz, true, Precision::float64);
  if (exact.scene().preset.precision != Precision::float32) {
    return 0;
  }
  Player rounded(name, rate_hz);
  double worst_db = -1e9;
  for (const int key : {36, 60, 84}) {
    const std::vector<TimedEvent> note = {{0.0, note_on(key, 100)}};
    worst_db = std::max(worst_db, greatest_difference_db(exact.play(note, sounding_s),
                                                         rounded.play(note, sounding_s)));
  }
  const bool is_wrong = worst_db > most_difference_db;
  std::printf("%s: %.1f dB%s\n", name.c_str(), worst_db, is_wrong ? " !" : "");
  std::fflush(stdout);
  return is_wrong ? 1 : 0;
}

}  // namespace ressort::voicing
