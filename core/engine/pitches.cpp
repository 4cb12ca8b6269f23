#include "core/engine/pitches.h"

#include <algorithm>

namespace ressort::engine {
namespace {

// The cubic Lagrange polynomial through the values y at 0, 1, 2 and 3.
double cubic(double t, const std::array<double, 4>& y) {
  return -(t - 1.0) * (t - 2.0) * (t - 3.0) / 6.0 * y[0] + t * (t - 2.0) * (t - 3.0) / 2.0 * y[1] -
         t * (t - 1.0) * (t - 3.0) / 2.0 * y[2] + t * (t - 1.0) * (t - 2.0) / 6.0 * y[3];
}

}  // namespace

double Pitches::factor_at(double frequency_hz) const {
  if (factors.empty()) {
    return 1.0;
  }
  constexpr double least = 1e-6;
  const auto last = static_cast<double>(factors.size() - 1);
  const double semitone = 12.0 * std::log2(frequency_hz / lowest_hz);
  if (factors.size() < 4 || semitone <= 0.0 || semitone >= last) {
    // Outside the table the frequency is proportional to the root of the stiffness, as without
    // dampers.
    const double end = semitone <= 0.0 ? 0.0 : last;
    return std::max(least,
                    factors[static_cast<std::size_t>(end)] * std::exp2((semitone - end) / 6.0));
  }
  const auto first =
      static_cast<std::size_t>(std::clamp(std::floor(semitone) - 1.0, 0.0, last - 3.0));
  const auto log_of = [&](std::size_t i) { return std::log(factors[first + i]); };
  return std::max(least, std::exp(cubic(semitone - static_cast<double>(first),
                                        {log_of(0), log_of(1), log_of(2), log_of(3)})));
}

double PitchesAlong::value_at(std::size_t index) const {
  const double way = static_cast<double>(index) / static_cast<double>(legs * steps);
  return by_ratios ? lowest * std::pow(highest / lowest, way) : lowest + (highest - lowest) * way;
}

double PitchesAlong::factor_at(double frequency_hz, double value) const {
  const double inside = std::clamp(value, lowest, highest);
  const double way = by_ratios ? std::log(inside / lowest) / std::log(highest / lowest)
                               : (inside - lowest) / (highest - lowest);
  // All four points must belong to one leg.
  const double legs_gone = way * static_cast<double>(legs);
  const double leg = std::min(std::floor(legs_gone), static_cast<double>(legs - 1));
  const double within = (legs_gone - leg) * static_cast<double>(steps);
  const double first = std::clamp(std::floor(within) - 1.0, 0.0, static_cast<double>(steps) - 3.0);
  const auto index = static_cast<std::size_t>(leg) * steps + static_cast<std::size_t>(first);
  const auto log_of = [&](std::size_t i) {
    return std::log(at[index + i].factor_at(frequency_hz));
  };
  return std::exp(cubic(within - first, {log_of(0), log_of(1), log_of(2), log_of(3)}));
}

double Pitches::inside(double frequency_hz) const {
  const double last = std::max(1.0, static_cast<double>(factors.size())) - 1.0;
  return std::clamp(frequency_hz, lowest_hz, lowest_hz * std::exp2(last / 12.0));
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

}  // namespace ressort::engine
