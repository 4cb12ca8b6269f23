// core/compile: the springs and dampers of a Program as matrices.
#pragma once

#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/kernels/program.h"
#include "core/linear_algebra/matrix.h"

namespace ressort::compile {

// A spring with its damper. Its length is a weighted sum of displacements of masses and of places
// on waveguides.
struct SpringDamper {
  std::vector<std::pair<std::uint32_t, double>> shares;  // moving node, weight
  double stiffness = 0.0;
  double damping = 0.0;
  bool is_own = false;  // belongs to an oscillator mass and is not a link
  Scheme scheme = Scheme::plain;
};
// `value`: [coefficient]. O(links)
std::vector<SpringDamper> spring_dampers_of(const Program& program,
                                            const std::vector<double>& value);

// M^-1/2 K M^-1/2 and M^-1/2 Z M^-1/2 of the moving masses, per sample of Program::rate_hz.
// Nonlinear links count as their linear spring.
struct Springs {
  std::size_t size() const { return stiffness.rows(); }

  Matrix stiffness;
  Matrix damping;
  bool is_sound = true;  // every mass is above 0 and every number is finite
};

// `is_sampled`: with the modes of bodies as the published scheme steps them. O(masses^2 + links)
Springs springs_of(const Program& program, std::span<const double> parameters,
                   double stiffness_factor, bool is_sampled = false);

// Returns an upper bound on (K + by_damping Z)/M of a mode, per sample, by the edge bound: the
// largest d_a/m_a + d_b/m_b of a link, where d is the sum of K + by_damping Z at a mass. O(links)
double steepness_of(const Program& program, std::span<const double> parameters, double by_damping);

// Returns whether any link is a spring or contains one.
bool has_linear_springs(const Program& program);
// Returns whether a nonlinear link contains a spring.
bool contains_bent_springs(const Program& program);

// A mode of a mass of 1, per sample.
struct SpringMode {
  double stiffness = 0.0;
  double damping = 0.0;
};
// Returns the modes, or nothing if damping is not proportional, that is if Z
// is not diagonal in the modes of K to 1e-9 of its largest element. O(masses^3)
std::optional<std::vector<SpringMode>> modes_of(const Springs& springs);

// Rayleigh damping: Z = by_mass M + by_stiffness K, element by element.
struct Rayleigh {
  double by_mass = 0.0;
  double by_stiffness = 0.0;
};
// Returns nothing if no such numbers exist. O(links)
std::optional<Rayleigh> rayleigh_of(const Program& program, std::span<const double> parameters,
                                    double stiffness_factor);

}  // namespace ressort::compile
