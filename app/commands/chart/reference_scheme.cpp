#include "app/commands/chart/reference_scheme.h"

#include <algorithm>

#include "core/laws/laws.h"

template <>
struct ressort::ScalarOf<long double> {
  using Type = long double;
};

namespace ressort::commands {
ReferenceScheme::ReferenceScheme(const Program& program)
    : program_(program),
      x_(program.position.begin(), program.position.end()),
      v_(program.velocity.begin(), program.velocity.end()),
      force_(x_.size()),
      pushed_(x_.size()) {
  for (const Coefficient& one : program.coefficients) {
    coefficient_.push_back(coefficient_value(program, one, program.parameters, 1.0));
  }
  for (const TapSlot& tap : program.taps) {
    corners_.push_back(corners_at<Real>(tap, coefficient_[tap.u], coefficient_[tap.v]));
  }
}

// Calls use(node, weight) for the node itself, or for the nodes that carry a place on a macro.
template <class Use>
void ReferenceScheme::behind(std::uint32_t node, Use&& use) const {
  if (program_.taps.empty() || node < program_.taps[0].node) {
    return use(node, Real(1));
  }
  const std::size_t tap = node - program_.taps[0].node;
  each_behind(program_, program_.taps[tap], corners_[tap], use);
}

void ReferenceScheme::push(std::uint32_t node, Real force) {
  behind(node, [&](std::uint32_t at, Real weight) {
    force_[at] += weight * force;
    pushed_[at] += weight * force;
  });
}

void ReferenceScheme::move_masses() {
  for (const MassRun& run : program_.mass_runs) {
    const Real k = run.is_oscillator ? coefficient_[run.stiffness] : 0;
    const Real z = run.is_oscillator ? coefficient_[run.damping] : 0;
    const Real g = run.has_gravity ? coefficient_[run.gravity] : 0;
    for (std::uint32_t i = run.first; i < run.first + run.count; ++i) {
      v_[i] += (force_[i] - k * x_[i] - z * v_[i] - g) * coefficient_[run.inverse_mass];
      x_[i] += v_[i];
    }
  }
  std::fill(force_.begin(), force_.end(), Real(0));
}

void ReferenceScheme::move_places() {
  for (const TapSlot& tap : program_.taps) {
    Real position = 0;
    behind(tap.node, [&](std::uint32_t at, Real weight) { position += weight * x_[at]; });
    v_[tap.node] = position - x_[tap.node];
    x_[tap.node] = position;
  }
}

void ReferenceScheme::pull() {
  for (const LinkRun& run : program_.link_runs) {
    const auto c = [&](std::size_t i) { return coefficient_[run.coefficients[i]]; };
    with_law<Real>(run.law, c, [&](const auto& law) {
      for (std::uint32_t i = run.first; i < run.first + run.count; ++i) {
        const auto [a, b] = program_.ends[i];
        const Real f = law.force(x_[a] - x_[b], v_[a] - v_[b]);
        force_[a] -= f;
        force_[b] += f;
      }
    });
  }
  for (const TapSlot& tap : program_.taps) {
    const Real force = force_[tap.node];
    force_[tap.node] = 0;
    behind(tap.node, [&](std::uint32_t at, Real weight) { force_[at] += weight * force; });
  }
}

void ReferenceScheme::step(std::span<const double> value, std::span<const double> velocity) {
  std::fill(pushed_.begin(), pushed_.end(), Real(0));
  for (std::size_t i = 0; i < program_.inputs.size(); ++i) {
    if (program_.inputs[i].is_force) {
      push(program_.inputs[i].node, value[i]);
    }
  }
  move_masses();
  for (std::size_t i = 0; i < program_.inputs.size(); ++i) {
    if (!program_.inputs[i].is_force) {
      x_[program_.inputs[i].node] = value[i];
      v_[program_.inputs[i].node] = velocity[i];
    }
  }
  move_places();
  pull();
}

std::vector<double> ReferenceScheme::outputs() const {
  std::vector<double> values;
  const Real unit = Real{program_.rate_ratio} * program_.rate_ratio;
  for (const OutputSlot& output : program_.outputs) {
    Real value = x_[output.node];
    if (output.is_force) {
      value = 0;
      behind(output.node, [&](std::uint32_t at, Real weight) {
        value += weight * (force_[at] + pushed_[at]) / unit;
      });
    }
    values.push_back(static_cast<double>(value));
  }
  return values;
}

}  // namespace ressort::commands
