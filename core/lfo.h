// core: low-frequency oscillators, one per voice, as a player's vibrato and tremolo.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "core/noise.h"

namespace ressort {

enum class LfoShape : std::uint8_t { sine, triangle, random, steps, fall };

// Tempo without a clock: 120 beats per minute.
inline constexpr double usual_beats_per_s = 2.0;

struct Lfo {
  double rate_hz = 5.0;
  double beats = 0.0;    // length of an oscillation in beats, in place of the rate; 0: `rate_hz`
  double delay_s = 0.0;  // from the start of the note
  double fade_s = 0.0;   // from the end of the delay to the full depth
  LfoShape shape = LfoShape::sine;
  double depth = 1.0;
  double deviation = 0.0;  // greatest relative difference of the rate from note to note
  double rate_at(double beats_per_s) const { return beats > 0.0 ? beats_per_s / beats : rate_hz; }
  bool operator==(const Lfo&) const = default;
};

// The oscillator of one note. It starts at 0, upwards, when the delay ends. [audio] wait-free
class LfoState {
 public:
  LfoState() = default;
  LfoState(const Lfo& lfo, double beats_per_s, std::uint64_t seed) : random_(seed) {
    detuning_ = 1.0 + lfo.deviation * random_.next();
    rate_hz_ = lfo.rate_at(beats_per_s) * detuning_;
    to_ = random_.next();
  }
  // Changes the rate of an LFO in beats. The oscillation continues at its phase.
  void set_tempo(const Lfo& lfo, double beats_per_s) {
    if (const double t = age_s_ - lfo.delay_s; t > 0.0) {
      turns_ = turns_at(t);
      changed_at_s_ = t;
    }
    rate_hz_ = lfo.rate_at(beats_per_s) * detuning_;
  }
  void advance(double seconds) { age_s_ += seconds; }
  // Returns a value in -depth..depth. The random shape joins random points by straight lines, one
  // point per period. The steps keep a random value for a period, from the start. The fall starts
  // at the depth and decreases by the factor e in each period.
  double value(const Lfo& lfo) {
    const double t = age_s_ - lfo.delay_s;
    if (t < 0.0) {
      return 0.0;
    }
    const double turns = turns_at(t);
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
      case LfoShape::fall:
        return depth * std::exp(-turns);
    }
    return 0.0;
  }

 private:
  double turns_at(double t) const { return turns_ + (t - changed_at_s_) * rate_hz_; }

  double age_s_ = 0.0;
  double rate_hz_ = 0.0;
  double detuning_ = 1.0;      // factor on the rate
  double changed_at_s_ = 0.0;  // time of the last change of the rate, after the delay
  double turns_ = 0.0;         // turns until then
  RandomNumbers random_;
  double from_ = 0.0;
  double to_ = 0.0;
  double next_point_ = 1.0;  // turns at which the next random point is drawn
};

}  // namespace ressort
