// core: discretises a continuous mode exactly for the published scheme. Shared by the analysis and
// the kernels, which do not see each other.
#pragma once

#include <algorithm>
#include <cmath>

namespace ressort {

// Modes above the first w^2 per sample (0.456 of the rate) decay faster and faster. Modes above the
// second do not ring; they follow the force quasi-statically.
inline constexpr double highest_ring = 8.2;
inline constexpr double nyquist_ring = 9.8;

// For x'' + z x' + k x = f / m, all per sample, let r = e^(-z/2) and w^2 = k - z^2/4. The scheme
//   v += (f - K x - Z v) / M,  x += v
// then has the exact pole r e^(jw) with M = m, K = m (1 + r^2 - 2 r cos w), Z = m (1 - r^2). A mode
// too high to ring has M = K = Z = k m, which moves it to its static deflection in the next sample.
struct SampledMode {
  double mass = 0.0;
  double stiffness = 0.0;
  double damping = 0.0;
};

// [any thread] wait-free
inline SampledMode sampled_mode(double m, double k, double z) {
  const double half = 0.5 * z;
  const double square = k - half * half;
  const double root = std::sqrt(std::fabs(square));
  const double r = std::exp(-half);
  const double lost = -std::expm1(-half);
  const double sine = std::sin(0.5 * root);
  // These forms avoid cancellation. An overdamped mode has two real poles, exp(-half +- root).
  const double stiffness = square >= 0.0
                               ? lost * lost + 4.0 * r * sine * sine
                               : std::expm1(-k / (half + root)) * std::expm1(-half - root);
  const double damping = -std::expm1(-z);
  const double left_out =
      std::clamp((square - highest_ring) / (nyquist_ring - highest_ring), 0.0, 1.0);
  const double mass = m * (1.0 + left_out * (k - 1.0));
  return {mass, mass * (stiffness + left_out * (1.0 - stiffness)),
          mass * (damping + left_out * (1.0 - damping))};
}

}  // namespace ressort
