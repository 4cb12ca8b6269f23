// core: a continuous mode as the published scheme steps it at a rate. Seen by the analysis and by
// the kernels, which never see each other.
#pragma once

#include <algorithm>
#include <cmath>

namespace ressort {

// w^2 per sample from which on a mode decays the faster (0.456 of the rate), and from which on it
// rings no more, but gives way as it would at rest.
inline constexpr double highest_ring = 8.2;
inline constexpr double nyquist_ring = 9.8;

// x'' + z x' + k x = f / m, all per sample: with r = e^(-z/2) and w^2 = k - z^2/4 the scheme
//   v += (f - K x - Z v) / M,  x += v
// has the same pole r e^(jw) with M = m, K = m (1 + r^2 - 2 r cos w), Z = m (1 - r^2). What is too
// high to ring has M = K = Z = k m: it is where f pushes it at the next sample.
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
  // No difference of equals. A mode that creeps has two real poles, each e to one of these sums.
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
