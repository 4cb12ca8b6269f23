// core: seeded noise. The same seed gives the same noise, so renders repeat.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <utility>

#include "core/random.h"

namespace ressort {

// Uniform numbers in -1..1. Any seed is valid. [audio] wait-free
class RandomNumbers {
 public:
  explicit RandomNumbers(std::uint64_t seed = 0)
      : state_(std::max<std::uint64_t>(1, splitmix64(seed))) {}
  double next() { return white_sample(state_); }

 private:
  std::uint64_t state_;
};

// White noise through a one-pole highpass and a one-pole lowpass by the bilinear transform, so that
// both are at -3 dB at exactly their frequencies at any sample rate. Its rms is 1: the variance of
// (1 - z^-2) / ((1 - a z^-1)(1 - b z^-1)) is 2 / (1 - a b). [audio] wait-free
class BandNoise {
 public:
  BandNoise() = default;
  BandNoise(std::uint64_t seed, double low_hz, double high_hz, double rate_hz) : white_(seed) {
    const auto pole_at = [&](double hz) {
      constexpr double highest = 0.45;  // of the sample rate
      const double t = std::tan(std::numbers::pi * std::min(hz / rate_hz, highest));
      return (1.0 - t) / (1.0 + t);
    };
    const double a = pole_at(low_hz);
    const double b = pole_at(high_hz);
    sum_ = a + b;
    product_ = a * b;
    constexpr double variance_of_white = 1.0 / 3.0;
    gain_ = std::sqrt(0.5 * (1.0 - product_) / variance_of_white);
  }
  double next() {
    double sample = 0.0;
    each(1, [&](std::size_t, double only) { sample = only; });
    return sample;
  }
  // Calls use(n, sample) for the next samples.
  template <class Use>
  void each(std::size_t count, Use&& use) {
    RandomNumbers white = white_;
    double x1 = x1_;
    double x2 = x2_;
    double y1 = y1_;
    double y2 = y2_;
    for (std::size_t n = 0; n < count; ++n) {
      const double x = white.next();
      const double y = (gain_ * (x - x2) - product_ * y2) + sum_ * y1;
      use(n, y);
      x2 = std::exchange(x1, x);
      y2 = std::exchange(y1, y);
    }
    white_ = white;
    x1_ = x1;
    x2_ = x2;
    y1_ = y1;
    y2_ = y2;
  }

 private:
  RandomNumbers white_;
  double gain_ = 0.0;
  double sum_ = 0.0;      // of both poles
  double product_ = 0.0;  // of both poles
  double x1_ = 0.0;
  double x2_ = 0.0;
  double y1_ = 0.0;
  double y2_ = 0.0;
};

}  // namespace ressort
