// Tests the stability of a network by simulation, and returns its bound.
#pragma once

#include <cmath>
#include <string>

#include "core/analysis/stability.h"
#include "core/model/topology.h"
#include "tests/support/harness.h"

namespace ressort::support {

inline constexpr double bound_limit = 3.92;  // 4 less a margin of two per cent.

inline const std::string mass_and_ground = "@m mass 2. 0. 0.\n@g ground 0.\n";

inline double factor_of(const std::string& text, double rate_ratio = 1.0) {
  const Network network = expand_macros(network_of(text));
  const auto values = parameter_values(network);
  return Stability(network, rate_ratio).bounded_stiffness_factor({values, values});
}

// Growth of a network after an impulse, with every stiffness multiplied by a factor.
inline double growth(const Network& network, double factor) {
  Program program = make_program(network, 44100.0, true);
  for (std::size_t i = 0; i < program.moving; ++i) {
    program.velocity[i] = std::cos(3.0 * static_cast<double>(i));
  }
  support::Bare<double> bare(program);
  bare.set_coefficients(0, program.parameters, factor, false);
  double largest = 0.0;
  for (int n = 0; n < 20000 && largest < 1e12; ++n) {
    for (const double y : bare.step({})) {
      largest = std::max(largest, std::fabs(y));
    }
  }
  return largest;
}

}  // namespace ressort::support
