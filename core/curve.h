// core: a curve of straight lines between points, as a preset draws one.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

namespace ressort {

using CurvePoint = std::array<double, 2>;  // where, and how much there

// Between points whose first numbers ascend; beyond them as much as at the nearest. There is one at
// least. [any thread] wait-free, O(points)
inline double value_at(const std::vector<CurvePoint>& points, double where) {
  std::size_t next = 0;
  while (next < points.size() && points[next][0] < where) {
    ++next;
  }
  if (next == 0 || next == points.size()) {
    return points[std::min(next, points.size() - 1)][1];
  }
  const CurvePoint& a = points[next - 1];
  const CurvePoint& b = points[next];
  return a[1] + (b[1] - a[1]) * (where - a[0]) / (b[0] - a[0]);
}

// Whether a range is so wide that equal turns are equal ratios of it.
constexpr bool is_wide(double minimum, double maximum) {
  return minimum > 0.0 && maximum >= 10.0 * minimum;
}

}  // namespace ressort
