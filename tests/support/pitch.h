// tests: the pitch of a sound, by nothing but the sound.
#pragma once

#include <cmath>
#include <numbers>
#include <span>

namespace ressort::support {

// The frequency where the spectrum under a Hann window is largest, near a guess. A decaying sine
// has its peak at its own frequency, and the window keeps the others out of the way.
inline double measured_hz(std::span<const double> y, double rate_hz, double guess_hz) {
  const auto magnitude = [&](double hz) {
    const double step = 2.0 * std::numbers::pi * hz / rate_hz;
    double re = 0.0;
    double im = 0.0;
    for (std::size_t n = 0; n < y.size(); ++n) {
      const auto time = static_cast<double>(n);
      const double window =
          1.0 - std::cos(2.0 * std::numbers::pi * time / static_cast<double>(y.size()));
      re += window * y[n] * std::cos(step * time);
      im += window * y[n] * std::sin(step * time);
    }
    return re * re + im * im;
  };
  double low = guess_hz * 0.97;
  double high = guess_hz * 1.03;
  for (int i = 0; i < 40; ++i) {  // golden section
    const double a = high - (high - low) * 0.6180339887498949;
    const double b = low + (high - low) * 0.6180339887498949;
    if (magnitude(a) > magnitude(b)) {
      high = b;
    } else {
      low = a;
    }
  }
  return 0.5 * (low + high);
}

}  // namespace ressort::support
