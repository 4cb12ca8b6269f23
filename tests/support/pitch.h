// tests: measures the pitch of a sound from the sound only.
#pragma once

#include <cmath>
#include <complex>
#include <numbers>
#include <span>
#include <vector>

namespace ressort::support {

// Returns the frequency of the largest peak near a guess in the spectrum under a Hann window. A
// decaying sine peaks at its own frequency, and the window suppresses other partials. `width`:
// relative search range, narrow enough to exclude a second peak.
inline double measured_hz(std::span<const double> y, double rate_hz, double guess_hz,
                          double width = 0.03) {
  std::vector<double> seen(y.begin(), y.end());
  for (std::size_t n = 0; n < seen.size(); ++n) {
    seen[n] *= 1.0 - std::cos(2.0 * std::numbers::pi * static_cast<double>(n) /
                              static_cast<double>(seen.size()));
  }
  const auto magnitude = [&](double hz) {
    const std::complex<double> turn = std::polar(1.0, -2.0 * std::numbers::pi * hz / rate_hz);
    std::complex<double> wave = 1.0;
    std::complex<double> sum = 0.0;
    for (const double sample : seen) {
      sum += sample * wave;
      wave *= turn;
    }
    return std::norm(sum);
  };
  double low = guess_hz * (1.0 - width);
  double high = guess_hz * (1.0 + width);
  for (int i = 0; i < 40; ++i) {  // Golden-section search.
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
