#include "core/engine/program.h"

#include <algorithm>
#include <cmath>

namespace ressort {
namespace {

constexpr double reference_rate_hz = 44100.0;

}  // namespace

bool is_plain(const Program& program) {
  return std::all_of(program.link_runs.begin(), program.link_runs.end(),
                     [](const LinkRun& run) { return run.scheme == Scheme::plain; });
}

double coefficient_value(const Program& program, const Coefficient& coefficient,
                         std::span<const double> parameters, double stiffness_factor) {
  const double value =
      evaluate(std::span(program.steps).subspan(coefficient.first, coefficient.count), parameters);
  const double r = program.rate_ratio;
  switch (coefficient.unit) {
    case Unit::plain:
      return value;
    case Unit::stiffness:
      return value * r * r * stiffness_factor;
    case Unit::damping:
      return value * r;
    case Unit::friction:
    case Unit::speed:
      return value * r * std::sqrt(stiffness_factor);
    case Unit::inverse_mass:
      return 1.0 / value;
    case Unit::gravity:
      return value * r * r;
    case Unit::gravity_per_rate:
      return value * r * r / reference_rate_hz;
  }
  return value;
}

}  // namespace ressort
