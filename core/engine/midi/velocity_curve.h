// core/engine/midi: what a preset makes of how fast a key goes down.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

namespace ressort {

// A power of the velocity, or straight lines between points where there are some.
struct VelocityCurve {
  // Velocities 0..1 and what they become, both ascending.
  std::vector<std::array<double, 2>> points;
  double exponent = 1.0;

  // [audio] wait-free, O(points)
  double operator()(double velocity) const {
    const double v = std::clamp(velocity, 0.0, 1.0);
    if (points.empty()) {
      return exponent == 1.0 ? velocity : std::pow(v, exponent);
    }
    std::size_t next = 0;
    while (next < points.size() && points[next][0] < v) {
      ++next;
    }
    if (next == 0 || next == points.size()) {
      return points[std::min(next, points.size() - 1)][1];
    }
    const auto& a = points[next - 1];
    const auto& b = points[next];
    return a[1] + (b[1] - a[1]) * (v - a[0]) / (b[0] - a[0]);
  }
};

}  // namespace ressort
