#include <algorithm>
#include <cmath>

#include "core/engine/engine.h"

namespace ressort {

double Pitches::factor_at(double frequency_hz) const {
  if (factors.empty()) {
    return 1.0;
  }
  constexpr double least = 1e-6;
  const auto last = static_cast<double>(factors.size() - 1);
  const double semitone = 12.0 * std::log2(frequency_hz / lowest_hz);
  if (factors.size() < 4 || semitone <= 0.0 || semitone >= last) {
    // Beyond, as if there were no dampers.
    const double end = semitone <= 0.0 ? 0.0 : last;
    return std::max(least,
                    factors[static_cast<std::size_t>(end)] * std::exp2((semitone - end) / 6.0));
  }
  const auto first =
      static_cast<std::size_t>(std::clamp(std::floor(semitone) - 1.0, 0.0, last - 3.0));
  const double t = semitone - static_cast<double>(first);
  const auto log_of = [&](std::size_t i) { return std::log(factors[first + i]); };
  const double sum = -(t - 1.0) * (t - 2.0) * (t - 3.0) / 6.0 * log_of(0) +
                     t * (t - 2.0) * (t - 3.0) / 2.0 * log_of(1) -
                     t * (t - 1.0) * (t - 3.0) / 2.0 * log_of(2) +
                     t * (t - 1.0) * (t - 2.0) / 6.0 * log_of(3);
  return std::max(least, std::exp(sum));
}

double Pitches::frequency_at(double factor) const {
  double low = lowest_hz;
  double high = lowest_hz * std::exp2(static_cast<double>(factors.size()) / 12.0);
  for (int i = 0; i < 60; ++i) {
    const double middle = std::sqrt(low * high);
    (factor_at(middle) < factor ? low : high) = middle;
  }
  return low;
}

}  // namespace ressort
