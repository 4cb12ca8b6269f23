// core: piecewise linear curves, and curves over keys and velocity.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

namespace ressort {

using CurvePoint = std::array<double, 2>;  // x, y

// The key whose values a sound without a key has.
inline constexpr double middle_c = 60.0;

// Returns the curve's value at x. The points have ascending x, and there is at least one. Outside
// the points the curve is constant. `by_ratios`: the logarithm of the value is interpolated, and
// all values are above 0. [any thread] wait-free, O(points)
inline double value_at(const std::vector<CurvePoint>& points, double x, bool by_ratios = false) {
  std::size_t next = 0;
  while (next < points.size() && points[next][0] < x) {
    ++next;
  }
  if (next == 0 || next == points.size()) {
    return points[std::min(next, points.size() - 1)][1];
  }
  const CurvePoint& a = points[next - 1];
  const CurvePoint& b = points[next];
  return by_ratios ? a[1] * std::pow(b[1] / a[1], (x - a[0]) / (b[0] - a[0]))
                   : a[1] + (b[1] - a[1]) * (x - a[0]) / (b[0] - a[0]);
}

// The values of a parameter that differ from voice to voice: a curve over keys and velocity, which
// the parameter's shared value, the knob, moves as a whole. All functions: [any thread] wait-free,
// O(points).
struct VoiceCurve {
  std::vector<CurvePoint> keys;      // key and value; empty: the knob's value on every key
  std::vector<CurvePoint> velocity;  // velocity 0..127 and factor or offset; empty: no effect
  double keys_at = 0.0;              // the knob's value at which `keys` holds as written
  double lowest = 0.0;               // range of the knob and of all values
  double highest = 0.0;
  // True if only links of thrown masses, such as hammers, depend on the parameter. A voice that
  // moves to another key without a strike then keeps the parameter's value on the struck key.
  bool is_of_blow = false;

  // The knob and the velocity are factors if the range is above 0, and the logarithm of the values
  // is interpolated. They are offsets in any other range.
  bool is_by_ratios() const { return lowest > 0.0; }

  double on_key(double key, double knob) const { return limited(unlimited(key, knob)); }
  double at(double key, double velocity_of_note, double knob) const {
    const double value = unlimited(key, knob);
    return velocity.empty() ? limited(value)
           : is_by_ratios() ? limited(value * value_at(velocity, velocity_of_note))
                            : limited(value + value_at(velocity, velocity_of_note));
  }
  // LFOs move a value by factors or offsets, too.
  double neutral() const { return is_by_ratios() ? 1.0 : 0.0; }
  double joined(double a, double b) const { return is_by_ratios() ? a * b : a + b; }
  double moved(double value, double by) const { return limited(joined(value, by)); }

 private:
  double unlimited(double key, double knob) const {
    if (keys.empty()) {
      return knob;
    }
    const double value = value_at(keys, key, is_by_ratios());
    return is_by_ratios() ? value * (knob / keys_at) : value + (knob - keys_at);
  }
  double limited(double value) const { return std::max(lowest, std::min(value, highest)); }
};

// Returns whether a range is so wide that a knob maps to it by equal ratios.
constexpr bool is_wide(double minimum, double maximum) {
  return minimum > 0.0 && maximum >= 10.0 * minimum;
}

}  // namespace ressort
