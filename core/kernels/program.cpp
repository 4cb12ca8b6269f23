#include "core/kernels/program.h"

#include <algorithm>
#include <cmath>

#include "core/kernels/direct/direct_form.h"
#include "core/sampled_mode.h"

namespace ressort::kernels {
namespace {

constexpr double reference_rate_hz = 44100.0;

// Most formulas are one number or one parameter. These need no stack.
double value_of(std::span<const Step> formula, std::span<const double> parameters) {
  const bool is_one = formula.size() == 1;
  return is_one && formula[0].op == Op::parameter ? parameters[formula[0].index]
         : is_one && formula[0].op == Op::number  ? formula[0].value
                                                  : evaluate(formula, parameters);
}

}  // namespace

Form::Form() : Form(Direct{}) {}

bool is_plain(const Program& program) {
  return std::all_of(program.link_runs.begin(), program.link_runs.end(),
                     [](const LinkRun& run) { return run.scheme == Scheme::plain; });
}

const MassRun& run_of(const Program& program, std::uint32_t node) {
  const auto after =
      std::upper_bound(program.mass_runs.begin(), program.mass_runs.end(), node,
                       [](std::uint32_t n, const MassRun& run) { return n < run.first; });
  return *(after - 1);
}

double rate_factor(Unit unit, double r) {
  switch (unit) {
    case Unit::stiffness:
    case Unit::gravity:
    case Unit::gravity_per_rate:
      return r * r;
    case Unit::damping:
    case Unit::friction:
    case Unit::speed:
      return r;
    case Unit::inverse_impedance:
      return 1.0 / r;
    case Unit::plain:
    case Unit::inverse_mass:
    case Unit::frequency:
      return 1.0;
  }
  return 1.0;
}

double untuned_value(const Program& program, const Coefficient& coefficient,
                     std::span<const double> parameters) {
  const double value =
      value_of(std::span(program.steps).subspan(coefficient.first, coefficient.count), parameters);
  const double scaled = value * rate_factor(coefficient.unit, program.rate_ratio);
  return coefficient.unit == Unit::inverse_mass        ? 1.0 / value
         : coefficient.unit == Unit::inverse_impedance ? value
         : coefficient.unit == Unit::gravity_per_rate  ? scaled / reference_rate_hz
                                                       : scaled;
}

double tuned_value(const Program& program, const Coefficient& coefficient, double untuned,
                   double of_key) {
  const double stiffness_factor = coefficient.is_fixed ? 1.0 : of_key;
  switch (coefficient.unit) {
    case Unit::stiffness:
      return untuned * stiffness_factor;
    case Unit::friction:
    case Unit::speed:
    case Unit::frequency:
      return untuned * std::sqrt(stiffness_factor);
    case Unit::inverse_impedance:
      return rate_factor(coefficient.unit, program.rate_ratio) /
             (untuned * std::sqrt(stiffness_factor));
    case Unit::inverse_mass:
    case Unit::gravity_per_rate:
    case Unit::plain:
    case Unit::damping:
    case Unit::gravity:
      return untuned;
  }
  return untuned;
}

double continuous_value(const Program& program, const Coefficient& coefficient,
                        std::span<const double> parameters, double stiffness_factor) {
  return tuned_value(program, coefficient, untuned_value(program, coefficient, parameters),
                     stiffness_factor);
}

double sampled_value(const Program& program, const Coefficient& coefficient,
                     std::span<const double> parameters, double stiffness_factor) {
  if (coefficient.mode == no_mode) {
    return continuous_value(program, coefficient, parameters, stiffness_factor);
  }
  const SampledCoefficients& mode = program.modes[coefficient.mode];
  const auto value = [&](std::uint32_t c) {
    return continuous_value(program, program.coefficients[c], parameters, stiffness_factor);
  };
  const double inverse = value(mode.inverse_mass);
  const SampledMode sampled =
      sampled_mode(1.0 / inverse, inverse * value(mode.stiffness), inverse * value(mode.damping));
  return coefficient.unit == Unit::inverse_mass ? 1.0 / sampled.mass
         : coefficient.unit == Unit::stiffness  ? sampled.stiffness
                                                : sampled.damping;
}

double coefficient_value(const Program& program, const Coefficient& coefficient,
                         std::span<const double> parameters, double stiffness_factor) {
  return program.form.is_continuous()
             ? continuous_value(program, coefficient, parameters, stiffness_factor)
             : sampled_value(program, coefficient, parameters, stiffness_factor);
}

}  // namespace ressort::kernels
