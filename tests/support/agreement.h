// tests: the agreement required of every kernel with the direct one.
#pragma once

#include <algorithm>
#include <cmath>

#include "core/compile/plan.h"
#include "tests/support/harness.h"

namespace ressort::support {

// Returns the largest error in double, from the larger of the errors in float of the kernel and of
// the direct one. modal works in another basis, whose eigenvectors are computed in double.
//
// direct, chains, grid and batch add the same forces in every sample, in different orders. The
// error at frame N is the sum over n < N of H(N - n) r(n): r is the rounding of frame n, and H is
// the network's response, linearised around the motion, which grows with the condition of the
// network. The sums that are rounded and H are the same in both precisions, and the unit roundoff
// is 2^-24 in float and 2^-53 in double, so the two errors are random walks whose deviations differ
// by 2^-29. By the reflection principle, P(max |W| < b) = 4/pi (exp(-pi^2 / (8 b^2)) - ...) for a
// walk of deviation 1 at its end, and P(max |W| > a) < 4 (1 - Phi(a)). One walk exceeds 8 times the
// larger of two others with a probability of 6e-8, or 2e-4 in the 3,000 comparisons of all forms.
inline double tolerance_of(Method method, double peak, double worst_in_float) {
  constexpr double walks = 8.0;
  const double other_basis = 1e-9 * (peak > 0.0 ? peak : 1.0);
  return method == Method::modal ? other_basis
                                 : std::min(other_basis, walks * std::ldexp(worst_in_float, -29));
}

// Returns the least agreement in float that is required, unless the direct kernel itself is little
// better. Errors of a force output count relative to positions, and errors of quiet outputs
// relative to loud ones. A grid's border sums and a matrix's rows contain absolute positions, so
// they lose precision in rigid motion. Nonlinear links add the rounding of their thresholds, and
// drifting networks are far from 0.
inline double least_db(Method method, bool is_plain) {
  const bool is_of_links =
      method == Method::direct || method == Method::chains || method == Method::batch;
  return !is_plain ? 70.0 : is_of_links ? 100.0 : 90.0;
}
inline constexpr double hardly_db = 6.0;

// A silent output may contain rounding errors of other motion.
inline void check_double(Method method, const std::vector<Comparison>& outputs,
                         const std::vector<Comparison>& in_float,
                         const std::vector<Comparison>& direct_in_float) {
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    const double worst_in_float = std::max(in_float[i].worst, direct_in_float[i].worst);
    INFO("double is off by " << show(outputs[i].worst) << " of " << show(outputs[i].peak)
                             << ", float by " << show(worst_in_float));
    CHECK(outputs[i].worst <= tolerance_of(method, outputs[i].peak, worst_in_float));
  }
}

// `is_plain`: the network is linear and stays near 0.
inline void check_float(Method method, const std::vector<Comparison>& outputs,
                        const std::vector<Comparison>& direct, bool is_plain) {
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    INFO("float has " << outputs[i].snr_db() << " dB, direct " << direct[i].snr_db());
    const double wanted_db = std::min(least_db(method, is_plain), direct[i].snr_db() - hardly_db);
    CHECK((outputs[i].peak == 0.0 || outputs[i].snr_db() >= wanted_db));
  }
}

}  // namespace ressort::support
