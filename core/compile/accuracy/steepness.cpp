#include "core/compile/accuracy/steepness.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/compile/accuracy/springs.h"

namespace ressort::compile {

Steepness steepness_of(const Program& program, std::span<const double> parameters) {
  std::vector<double> value;
  for (const Coefficient& coefficient : program.coefficients) {
    value.push_back(coefficient_value(program, coefficient, parameters, 1.0));
  }
  const std::vector<SpringDamper> springs = spring_dampers_of(program, value);
  // Returns the largest d_a/m_a + d_b/m_b of a link and d_a/m_a of an oscillator, where d is the
  // sum of the weights at a mass.
  const auto bound = [&](double by_damping) {
    const auto weight_of = [&](const SpringDamper& one) {
      return std::max(0.0, one.stiffness) + by_damping * std::max(0.0, one.damping);
    };
    Vector sum(program.moving);
    for (const SpringDamper& one : springs) {
      for (const auto& [node, share] : one.shares) {
        sum[node] += std::fabs(share) * weight_of(one);
      }
    }
    for (const MassRun& run : program.mass_runs) {
      sum[std::slice(run.first, run.count, 1)] *= Vector(value[run.inverse_mass], run.count);
    }
    double most = 0.0;
    for (const SpringDamper& one : springs) {
      double both = 0.0;
      for (const auto& [node, share] : one.shares) {
        both += std::fabs(share) * sum[node];
      }
      most = weight_of(one) > 0.0 ? std::max(most, both) : most;
    }
    return most;
  };
  return {.stiffness = bound(0.0), .both = bound(6.0)};
}

}  // namespace ressort::compile
