// core/engine/midi: what a preset makes of how fast a key goes down.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/curve.h"
#include "core/rooms.h"

namespace ressort::engine {

// A power of the velocity, or straight lines between points where there are some.
struct VelocityCurve {
  // Velocities 0..1 and what they become, both ascending.
  std::vector<CurvePoint> points;
  double exponent = 1.0;

  // [audio] wait-free, O(points)
  double operator()(double velocity) const {
    const double v = std::clamp(velocity, 0.0, 1.0);
    if (points.empty()) {
      return exponent == 1.0 ? velocity : std::pow(v, exponent);
    }
    return value_at(points, v);
  }
};

}  // namespace ressort::engine
