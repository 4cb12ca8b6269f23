#include "core/compile/accuracy/springs.h"

#include <algorithm>
#include <cmath>

#include "core/kernels/taps.h"
#include "core/laws/law.h"
#include "core/linear_algebra/eigen.h"
#include "core/ranges.h"

namespace ressort::compile {
namespace {

// tolerance of off-diagonal elements, relative to the largest
constexpr double diagonal_tolerance = 1e-9;
constexpr double zero_tolerance = 1e-13;   // relative to the largest element
constexpr double ratio_tolerance = 1e-12;  // tolerance of equal ratios

bool is_place(const Program& program, std::uint32_t node) {
  return !program.taps.empty() && node >= program.taps[0].node;
}

std::vector<double> values_of(const Program& program, std::span<const double> parameters,
                              double stiffness_factor, bool is_sampled = false) {
  const auto value = is_sampled ? sampled_value : continuous_value;
  return mapped(program.coefficients, [&](const Coefficient& coefficient) {
    return value(program, coefficient, parameters, stiffness_factor);
  });
}

// Returns the [moving node] root of the inverse mass.
Vector roots_of(const Program& program, const std::vector<double>& value) {
  Vector root(program.moving);
  for (const MassRun& run : program.mass_runs) {
    root[std::slice(run.first, run.count, 1)] = std::sqrt(value[run.inverse_mass]);
  }
  return root;
}

// Calls use(spring) for every oscillator and every link that is or contains a spring.
template <class Use>
void each_spring(const Program& program, const std::vector<double>& value, Use&& use) {
  for (const MassRun& run : program.mass_runs) {
    for (std::uint32_t i = run.first; run.is_oscillator && i < run.first + run.count; ++i) {
      use(SpringDamper{.shares = {{i, 1.0}},
                       .stiffness = value[run.stiffness],
                       .damping = value[run.damping],
                       .is_own = true});
    }
  }
  std::vector<Corners<double>> corners;
  for (const TapSlot& tap : program.taps) {
    corners.push_back(corners_at(tap, value[tap.u], value[tap.v]));
  }
  for (const LinkRun& run : program.link_runs) {
    const LawFacts& law = facts_of(run.law);
    if (!law.contains_spring) {
      continue;
    }
    SpringDamper one{.stiffness = value[run.coefficients[law.slot(Role::stiffness)]],
                     .damping = value[run.coefficients[law.slot(Role::damping)]],
                     .scheme = run.scheme};
    const auto hang = [&](std::uint32_t node, double sign) {
      const auto add = [&](std::uint32_t at, double weight) {
        if (at < program.moving && weight != 0.0) {
          one.shares.emplace_back(at, sign * weight);
        }
      };
      if (!is_place(program, node)) {
        return add(node, 1.0);
      }
      const std::size_t tap = node - program.taps[0].node;
      each_behind(program, program.taps[tap], corners[tap], add);
    };
    for (std::uint32_t i = run.first; i < run.first + run.count; ++i) {
      one.shares.clear();
      hang(program.ends[i].a, 1.0);
      hang(program.ends[i].b, -1.0);
      use(one);
    }
  }
}

}  // namespace

std::vector<SpringDamper> spring_dampers_of(const Program& program,
                                            const std::vector<double>& value) {
  std::vector<SpringDamper> found;
  each_spring(program, value, [&](const SpringDamper& one) { found.push_back(one); });
  return found;
}

Springs springs_of(const Program& program, std::span<const double> parameters,
                   double stiffness_factor, bool is_sampled) {
  const std::size_t n = program.moving;
  Springs springs{Matrix(n, n), Matrix(n, n)};
  const std::vector<double> value = values_of(program, parameters, stiffness_factor, is_sampled);
  const Vector root = roots_of(program, value);
  each_spring(program, value, [&](const SpringDamper& one) {
    for (const auto& [i, a] : one.shares) {
      for (const auto& [j, b] : one.shares) {
        const double share = a * b * root[i] * root[j];
        springs.stiffness(i, j) += share * one.stiffness;
        springs.damping(i, j) += share * one.damping;
      }
    }
  });
  springs.is_sound =
      std::ranges::all_of(root, [](double r) { return r > 0.0 && std::isfinite(r); }) &&
      std::isfinite(springs.stiffness.values.sum()) && std::isfinite(springs.damping.values.sum());
  return springs;
}

double steepness_of(const Program& program, std::span<const double> parameters, double by_damping) {
  const std::vector<double> value = values_of(program, parameters, 1.0);
  const auto weight_of = [&](const SpringDamper& one) {
    return std::max(0.0, one.stiffness) + by_damping * std::max(0.0, one.damping);
  };
  Vector sum(program.moving);
  each_spring(program, value, [&](const SpringDamper& one) {
    for (const auto& [node, share] : one.shares) {
      sum[node] += std::fabs(share) * weight_of(one);
    }
  });
  for (const MassRun& run : program.mass_runs) {
    sum[std::slice(run.first, run.count, 1)] *= Vector(value[run.inverse_mass], run.count);
  }
  double bound = 0.0;
  each_spring(program, value, [&](const SpringDamper& one) {
    double both = 0.0;
    for (const auto& [node, share] : one.shares) {
      both += std::fabs(share) * sum[node];
    }
    bound = weight_of(one) > 0.0 ? std::max(bound, both) : bound;
  });
  return bound;
}

bool has_linear_springs(const Program& program) {
  return std::ranges::any_of(program.link_runs,
                             [](const LinkRun& run) { return facts_of(run.law).contains_spring; });
}

bool contains_bent_springs(const Program& program) {
  return std::ranges::any_of(program.link_runs, [](const LinkRun& run) {
    return !is_linear(run.law) && facts_of(run.law).contains_spring;
  });
}

std::optional<std::vector<SpringMode>> modes_of(const Springs& springs) {
  const double most_k = std::max(largest(springs.stiffness.values), 1e-300);
  const double most_z = std::max(largest(springs.damping.values), 1e-300);
  // Eigenvectors of a mixture of K and Z in an irrational ratio: it separates modes of equal
  // stiffness but different damping.
  Matrix mixture = springs.stiffness;
  mixture.values =
      springs.stiffness.values / most_k + 0.6180339887498949 / most_z * springs.damping.values;
  const Matrix shapes = symmetric_eigenpairs(mixture).vectors;
  const Matrix k = in_basis(springs.stiffness, shapes);
  const Matrix z = in_basis(springs.damping, shapes);
  std::vector<SpringMode> modes;
  for (std::size_t j = 0; j < k.columns(); ++j) {
    for (std::size_t i = 0; i < k.rows(); ++i) {
      if (i != j && !(std::fabs(k(i, j)) <= diagonal_tolerance * most_k &&
                      std::fabs(z(i, j)) <= diagonal_tolerance * most_z)) {
        return std::nullopt;
      }
    }
    modes.push_back({k(j, j) < zero_tolerance * most_k ? 0.0 : k(j, j),
                     z(j, j) < zero_tolerance * most_z ? 0.0 : z(j, j)});
  }
  return modes;
}

std::optional<Rayleigh> rayleigh_of(const Program& program, std::span<const double> parameters,
                                    double stiffness_factor) {
  const std::vector<double> value = values_of(program, parameters, stiffness_factor);
  std::optional<double> by_stiffness;
  bool is_alike = true;
  for (const LinkRun& run : program.link_runs) {
    const LawFacts& law = facts_of(run.law);
    if (!law.contains_spring) {
      continue;
    }
    const double k = value[run.coefficients[law.slot(Role::stiffness)]];
    const double z = value[run.coefficients[law.slot(Role::damping)]];
    if (k == 0.0 && z == 0.0) {
      continue;
    }
    by_stiffness = by_stiffness.value_or(z / k);
    is_alike = is_alike && k > 0.0 && std::fabs(z - *by_stiffness * k) <= ratio_tolerance * z;
  }
  std::optional<double> by_mass;
  for (const MassRun& run : program.mass_runs) {
    const double beside =
        run.is_oscillator ? value[run.damping] - by_stiffness.value_or(0.0) * value[run.stiffness]
                          : 0.0;
    const double rate = beside * value[run.inverse_mass];
    by_mass = by_mass.value_or(rate);
    is_alike =
        is_alike && std::fabs(rate - *by_mass) <= ratio_tolerance * (std::fabs(rate) + 1e-300);
  }
  const Rayleigh found{by_mass.value_or(0.0), by_stiffness.value_or(0.0)};
  return is_alike && found.by_mass >= 0.0 && std::isfinite(found.by_stiffness)
             ? std::optional(found)
             : std::nullopt;
}

}  // namespace ressort::compile
