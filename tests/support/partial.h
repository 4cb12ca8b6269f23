// tests: measures one partial of a sound from its phase and level.
#pragma once

#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

namespace ressort::support {

// A partial's frequency and T60, measured between two windows of a second or less: the frequency
// from the phase advance beyond a guess, the decay from the drop in level. A four-term
// Blackman-Harris window suppresses other partials by 92 dB.
struct HeardPartial {
  double hz = 0.0;
  double t60_s = 0.0;
};

inline HeardPartial partial_of(const std::vector<double>& y, double rate_hz, double guess_hz,
                               double from_s, double length_s, double apart_s) {
  const auto length = static_cast<std::size_t>(length_s * rate_hz);
  const auto apart = static_cast<std::size_t>(apart_s * rate_hz);
  const auto at = [&](std::size_t first) {
    std::complex<double> sum;
    for (std::size_t n = 0; n < length; ++n) {
      const double turn =
          2.0 * std::numbers::pi * static_cast<double>(n) / static_cast<double>(length);
      const double window = 0.35875 - 0.48829 * std::cos(turn) + 0.14128 * std::cos(2.0 * turn) -
                            0.01168 * std::cos(3.0 * turn);
      const double phase =
          -2.0 * std::numbers::pi * guess_hz * static_cast<double>(first + n) / rate_hz;
      sum += window * y[first + n] * std::polar(1.0, phase);
    }
    return sum;
  };
  const auto first = static_cast<std::size_t>(from_s * rate_hz);
  const std::complex<double> ratio = at(first + apart) / at(first);
  const double seconds = static_cast<double>(apart) / rate_hz;
  return {.hz = guess_hz + std::arg(ratio) / (2.0 * std::numbers::pi * seconds),
          .t60_s = -std::log(1000.0) * seconds / std::log(std::abs(ratio))};
}

inline double cents(double hz, double of_hz) {
  return 1200.0 * std::log2(hz / of_hz);
}

}  // namespace ressort::support
