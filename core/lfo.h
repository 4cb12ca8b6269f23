// core: low-frequency oscillators, one per voice, as a player's vibrato and tremolo.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "core/noise.h"

namespace ressort {

enum class LfoShape : std::uint8_t { sine, triangle, random, steps };

struct Lfo {
  double rate_hz = 5.0;
  double delay_s = 0.0;  // from the start of the note
  double fade_s = 0.0;   // from the end of the delay to the full depth
  LfoShape shape = LfoShape::sine;
  double depth = 1.0;
  double deviation = 0.0;  // greatest relative difference of the rate from note to note
  bool operator==(const Lfo&) const = default;
};

// The oscillator of one note. It starts at 0, upwards, when the delay ends. [audio] wait-free
class LfoState {
 public:
  LfoState() = default;
  LfoState(const Lfo& lfo, std::uint64_t seed) : random_(seed) {
    rate_hz_ = lfo.rate_hz * (1.0 + lfo.deviation * random_.next());
    to_ = random_.next();
  }
  void advance(double seconds) { age_s_ += seconds; }
  // Returns a value in -depth..depth. The random shape joins random points by straight lines, one
  // point per period. The steps keep a random value for a period, from the start.
  double value(const Lfo& lfo) {
    const double t = age_s_ - lfo.delay_s;
    if (t < 0.0 || (t == 0.0 && lfo.shape != LfoShape::steps)) {
      return 0.0;
    }
    const double turns = t * rate_hz_;
    const double depth = lfo.depth * (lfo.fade_s > 0.0 ? std::min(1.0, t / lfo.fade_s) : 1.0);
    const double part = turns - std::floor(turns);
    switch (lfo.shape) {
      case LfoShape::sine:
        return depth * std::sin(2.0 * std::numbers::pi * part);
      case LfoShape::triangle:
        return depth * (std::fabs(std::fabs(4.0 * part - 1.0) - 2.0) - 1.0);
      case LfoShape::random:
      case LfoShape::steps:
        if (turns >= next_point_) {
          next_point_ = std::floor(turns) + 1.0;
          from_ = to_;
          to_ = random_.next();
        }
        return depth * (lfo.shape == LfoShape::steps ? to_ : from_ + (to_ - from_) * part);
    }
    return 0.0;
  }

 private:
  double age_s_ = 0.0;
  double rate_hz_ = 0.0;
  RandomNumbers random_;
  double from_ = 0.0;
  double to_ = 0.0;
  double next_point_ = 1.0;  // turns at which the next random point is drawn
};

}  // namespace ressort
