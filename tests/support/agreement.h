// tests: what every kernel owes to the direct one, which moves a network as it is written.
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

// What float keeps at least, unless the direct kernel keeps hardly more: of a force beside
// positions, of what is faint behind what is loud. A grid's sums at its border are of whole
// positions, and so are the rows of a matrix: they keep less of what moves as a whole and is hardly
// stretched. Links that are not linear add the rounding of where they act, and what drifts is far
// from 0.
inline double least_db(Method method, bool is_plain) {
  const bool is_of_links =
      method == Method::direct || method == Method::chains || method == Method::batch;
  return !is_plain ? 70.0 : is_of_links ? 100.0 : 90.0;
}
inline constexpr double hardly_db = 6.0;

// Where nothing is to be heard, the rounding of what moves elsewhere may be.
inline void check_double(Method method, const std::vector<Comparison>& outputs) {
  for (const Comparison& output : outputs) {
    INFO("double is off by " << show(output.worst) << " of " << show(output.peak));
    CHECK(output.worst <= tolerance_of(method) * (output.peak > 0.0 ? output.peak : 1.0));
  }
}

// `is_plain`: linear, and near 0.
inline void check_float(Method method, const std::vector<Comparison>& outputs,
                        const std::vector<Comparison>& direct, bool is_plain) {
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    INFO("float has " << outputs[i].snr_db() << " dB, direct " << direct[i].snr_db());
    const double wanted_db = std::min(least_db(method, is_plain), direct[i].snr_db() - hardly_db);
    CHECK((outputs[i].peak == 0.0 || outputs[i].snr_db() >= wanted_db));
  }
}

}  // namespace ressort::support
