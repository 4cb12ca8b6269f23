// tests: the agreement required of every kernel with the direct one.
#pragma once

#include <algorithm>

#include "core/compile/plan.h"
#include "tests/support/harness.h"

namespace ressort::support {

// Returns the largest error in double, as a share of the peak. direct, chains, grid and batch add
// the same forces in every sample, in different orders. modal works in another basis.
inline double tolerance_of(Method method) {
  return method == Method::modal ? 1e-9 : 1e-12;
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
inline void check_double(Method method, const std::vector<Comparison>& outputs) {
  for (const Comparison& output : outputs) {
    INFO("double is off by " << show(output.worst) << " of " << show(output.peak));
    CHECK(output.worst <= tolerance_of(method) * (output.peak > 0.0 ? output.peak : 1.0));
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
