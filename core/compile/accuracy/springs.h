// core/compile: the springs and dampers of a Program as matrices.
#pragma once

#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/kernels/program.h"
#include "core/linear_algebra/matrix.h"

namespace ressort::compile {

// A spring with its damper, felt by a sum of masses and of places on waveguides. Its numbers are
// those of the Program's coefficients.
struct SpringDamper {
  std::vector<std::pair<std::uint32_t, double>> shares;  // node that moves, weight
  double stiffness = 0.0;
  double damping = 0.0;
  bool is_own = false;  // of a mass, and no link
  Scheme scheme = Scheme::plain;
};
// `value` as the coefficients are. O(links)
std::vector<SpringDamper> spring_dampers_of(const Program& program,
                                            const std::vector<double>& value);

// Of the masses that move, for masses of 1: what each is to x times the root of its mass. Per
// sample of Program::rate_hz. What is nonlinear is open, but for the spring that it contains.
struct Springs {
  std::size_t size() const { return stiffness.rows(); }

  Matrix stiffness;
  Matrix damping;
  bool is_sound = true;  // every mass is above 0 and every number finite
};

// With places where the parameters put them; bodies' modes as the published scheme steps them if
// `is_sampled`. O(masses^2 + links)
Springs springs_of(const Program& program, std::span<const double> parameters,
                   double stiffness_factor, bool is_sampled = false);

// Whether any link is a spring, or contains one.
bool has_linear_springs(const Program& program);
// Whether any link is nonlinear and contains a spring.
bool contains_bent_springs(const Program& program);

// [mode] stiffness and damping; nothing where damping is not proportional: where Z is not diagonal
// in the modes of K to 1e-9 of the largest. O(masses^3)
std::optional<std::vector<std::pair<double, double>>> modes_of(const Springs& springs);

// Z = by_mass M + by_stiffness K, element by element.
struct Rayleigh {
  double by_mass = 0.0;
  double by_stiffness = 0.0;
};
// Nothing where no such numbers are. O(links)
std::optional<Rayleigh> rayleigh_of(const Program& program, std::span<const double> parameters,
                                    double stiffness_factor);

}  // namespace ressort::compile
