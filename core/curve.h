// core: piecewise linear curves.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

namespace ressort {

using CurvePoint = std::array<double, 2>;  // x, y

// Returns the curve's value at x. The points have ascending x, and there is at least one. Outside
// the points the curve is constant. [any thread] wait-free, O(points)
inline double value_at(const std::vector<CurvePoint>& points, double x) {
  std::size_t next = 0;
  while (next < points.size() && points[next][0] < x) {
    ++next;
  }
  if (next == 0 || next == points.size()) {
    return points[std::min(next, points.size() - 1)][1];
  }
  const CurvePoint& a = points[next - 1];
  const CurvePoint& b = points[next];
  return a[1] + (b[1] - a[1]) * (x - a[0]) / (b[0] - a[0]);
}

// Returns whether a range is so wide that a knob maps to it by equal ratios.
constexpr bool is_wide(double minimum, double maximum) {
  return minimum > 0.0 && maximum >= 10.0 * minimum;
}

}  // namespace ressort
