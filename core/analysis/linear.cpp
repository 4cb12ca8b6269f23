#include "core/analysis/linear.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "core/analysis/modes/linear_system.h"
#include "core/analysis/places.h"
#include "core/laws/law.h"
#include "core/linear_algebra/cholesky.h"
#include "core/linear_algebra/eigen.h"

namespace ressort::analysis {
namespace {

constexpr int dense_size = 64;  // Below this size a dense solver is faster and never fails.
// An eigenvalue below this share of the largest stiffness is rounding error: a rigid motion.
constexpr double rigid = 1e-12;
// Largest residual force of a mode, relative to the largest stiffness.
constexpr double tolerance = 1e-8;
constexpr double same = 1e-9;  // Modes that differ by less count as degenerate.
constexpr std::size_t most_shapes = 12;
constexpr std::size_t most_given = 3;
constexpr std::size_t most_fixed_shapes = 64;

// Returns the linear system of a network at these parameters, without inputs and outputs.
LinearSystem system_of(const Network& network, std::span<const double> parameters) {
  Network still = evaluated(network, parameters);
  still.inputs.clear();
  still.outputs.clear();
  return make_linear_system(still, 1.0, false);
}

double stretch_of(std::span<const std::pair<std::uint32_t, double>> shares, const Vector& vector) {
  double sum = 0.0;
  for (const auto& [row, share] : shares) {
    sum += share * vector[row];
  }
  return sum;
}

// Returns the damping matrix times a vector.
Vector damped(const LinearSystem& system, const Vector& vector) {
  Vector sum(vector.size());
  for (const ModalSpring& spring : system.springs) {
    const double force = spring.damping * stretch_of(system.of(spring), vector);
    for (const auto& [row, share] : system.of(spring)) {
      sum[row] += force * share;
    }
  }
  return sum;
}

// Extends a shape of the system whose fixed masses are held to a shape of the whole.
Vector lifted(const LinearSystem& whole, const LinearSystem& part, const Vector& shape) {
  Vector all(whole.size());
  for (std::size_t i = 0; i < part.size(); ++i) {
    const auto row = std::ranges::lower_bound(whole.masses, part.masses[i]);
    all[static_cast<std::size_t>(row - whole.masses.begin())] = shape[i];
  }
  return all;
}

// Returns the fixed masses as unit shapes, at most most_fixed_shapes of them.
std::vector<Vector> fixed_shapes(const Network& network, const LinearSystem& system) {
  std::vector<Vector> shapes;
  for (std::size_t i = 0; i < system.size() && shapes.size() < most_fixed_shapes; ++i) {
    if (network.masses[system.masses[i]].is_fixed) {
      shapes.emplace_back(system.size());
      shapes.back()[i] = 1.0;
    }
  }
  return shapes;
}

// Returns the share of a shape's motion that belongs to modes of bodies, 0 to 1.
double share_of_modes(const Network& network, const LinearSystem& system, const Vector& shape) {
  double sum = 0.0;
  for (std::size_t i = 0; i < system.size(); ++i) {
    sum += network.masses[system.masses[i]].is_mode ? shape[i] * shape[i] : 0.0;
  }
  return sum / dot(shape, shape);
}

// Projections on some vectors: the part of K that keys scale, Z, and the fixed part of K.
struct Projections {
  Matrix stiffness;
  Matrix damping;
  Matrix fixed;
};
Projections project(const Network& network, const LinearSystem& system,
                    const std::vector<Vector>& vectors) {
  const std::size_t count = vectors.size();
  Projections all{Matrix(count, count), Matrix(count, count), Matrix(count, count)};
  std::vector<double> stretch(count);
  for (const ModalSpring& spring : system.springs) {
    const bool is_fixed = spring.is_link ? network.links[spring.element].is_fixed
                                         : network.masses[spring.element].is_fixed;
    Matrix& stiffness = is_fixed ? all.fixed : all.stiffness;
    Matrix& damping = all.damping;
    for (std::size_t i = 0; i < count; ++i) {
      stretch[i] = stretch_of(system.of(spring), vectors[i]);
      for (std::size_t j = 0; j <= i; ++j) {
        stiffness(i, j) = stiffness(j, i) += spring.stiffness * stretch[i] * stretch[j];
        damping(i, j) = damping(j, i) += spring.damping * stretch[i] * stretch[j];
      }
    }
  }
  return all;
}

// The factorisation does not pivot, so an indefinite matrix may lose digits. Returns whether A x is
// value x nevertheless.
bool is_pair(const SparseMatrix& lower, double value, const Vector& vector, double most) {
  return largest(product(lower, vector) - value * vector) <= most;
}

// Computes eigenpairs from 0 upwards, as many as requested; all of them for a small matrix.
class Spectrum {
 public:
  Spectrum(const SparseMatrix& lower, double shift, const Progress& progress)
      : lower_(lower), shift_(shift), progress_(progress) {}

  std::optional<Eigenpairs> near_zero(int count) {
    if (lower_.size() <= dense_size) {
      if (!all_) {
        all_ = symmetric_eigenpairs(dense(lower_));
      }
      return all_;
    }
    if (!is_factored_ && !factor()) {
      return std::nullopt;
    }
    const auto size = static_cast<std::size_t>(lower_.size());
    return eigenpairs_near(shift_, count, lower_.size(), [&](const double* from, double* to) {
      std::copy_n(from, size, to);
      factor_.solve(to);
      progress_.spend(4 * size);
    });
  }

  // Applies (A - shift)^-1 to a vector, after eigenpairs were found.
  std::optional<Vector> inverse(Vector vector) {
    if (all_) {
      Vector sum(vector.size());
      for (std::size_t i = 0; i < vector.size(); ++i) {
        const Vector shape = all_->vectors.column(i);
        sum += dot(shape, vector) / (all_->values[i] - shift_) * shape;
      }
      return sum;
    }
    if (!is_factored_) {
      return std::nullopt;
    }
    factor_.solve(std::begin(vector));
    return vector;
  }

 private:
  bool factor() {
    SparseMatrix shifted = lower_;
    for (std::size_t k = 0; k + 1 < lower_.first.size(); ++k) {
      shifted.value[static_cast<std::size_t>(lower_.first[k])] -= shift_;
    }
    is_factored_ = factor_.analyze(lower_, progress_) && factor_.factor(shifted, progress_);
    return is_factored_;
  }

  const SparseMatrix& lower_;
  double shift_;
  const Progress& progress_;
  std::optional<Eigenpairs> all_;  // All pairs of a small matrix.
  Cholesky factor_;
  bool is_factored_ = false;
};

// The lowest eigenpairs and the index of the first one above the rigid motions.
struct Lowest {
  Eigenpairs pairs;
  std::size_t first = 0;
};

// Tries with `wanted` pairs, which usually suffice, then with more.
std::optional<Lowest> lowest_pairs(Spectrum& spectrum, const SparseMatrix& lower, double stiffest,
                                   int wanted) {
  const double floor = rigid * stiffest;
  for (const int count : {wanted, 1, 6}) {
    const std::optional<Eigenpairs> pairs = spectrum.near_zero(std::min(count, lower.size() - 1));
    if (!pairs) {
      continue;
    }
    const auto above =
        std::ranges::find_if(pairs->values, [&](double value) { return value > floor; });
    if (above != std::end(pairs->values)) {
      const auto first = static_cast<std::size_t>(above - std::begin(pairs->values));
      return is_pair(lower, pairs->values[first], pairs->vectors.column(first),
                     tolerance * stiffest)
                 ? std::optional(Lowest{*pairs, first})
                 : std::nullopt;
    }
  }
  return std::nullopt;
}

// Orthogonalises a vector against others and normalises it; empty if nothing is left.
std::optional<Vector> apart_from(const std::vector<Vector>& others, Vector vector) {
  const double before = std::sqrt(dot(vector, vector));
  // The second round removes the rounding error of the first (reorthogonalisation).
  for (int round = 0; round < 2; ++round) {
    for (const Vector& other : others) {
      vector -= dot(other, vector) * other;
    }
  }
  const double length = std::sqrt(dot(vector, vector));
  return length > 1e-9 * before ? std::optional<Vector>(vector / length) : std::nullopt;
}

// Returns the lowest shapes, the least damped of degenerate ones first, and the static response of
// the network to the first one's dampers.
std::vector<Vector> shapes_of(const Network& network, const LinearSystem& system,
                              const Lowest& lowest, Spectrum& spectrum) {
  const auto& [pairs, first] = lowest;
  const std::size_t count = std::min(pairs.vectors.columns(), most_shapes);
  std::vector<Vector> alike;
  std::vector<Vector> others;
  for (std::size_t i = 0; i < std::max(count, first + 1); ++i) {
    const bool is_alike = i >= first && pairs.values[i] < pairs.values[first] * (1.0 + same);
    (is_alike ? alike : others).push_back(pairs.vectors.column(i));
  }
  const Matrix turn = symmetric_eigenpairs(project(network, system, alike).damping).vectors;
  std::vector<Vector> shapes;
  for (std::size_t i = 0; i < alike.size(); ++i) {
    shapes.emplace_back(alike[0].size());
    for (std::size_t j = 0; j < alike.size(); ++j) {
      shapes.back() += turn(j, i) * alike[j];
    }
  }
  shapes.insert(shapes.end(), others.begin(), others.end());
  Vector shape = shapes.front();
  for (std::size_t i = 0; i < most_given && shapes.size() < alike[0].size(); ++i) {
    const std::optional<Vector> given = spectrum.inverse(damped(system, shape));
    const auto apart = given ? apart_from(shapes, *given) : std::nullopt;
    if (!apart) {
      break;
    }
    shape = *apart;
    shapes.push_back(*apart);
  }
  return shapes;
}

// Returns the network with all fixed elements held in place; the rest has the mode that keys tune.
// Empty if nothing is fixed.
std::optional<Network> fixed_held(const Network& network) {
  if (std::ranges::none_of(network.masses,
                           [](const Mass& mass) { return mass.is_fixed && moves(mass); })) {
    return std::nullopt;
  }
  Network held = network;
  for (Mass& mass : held.masses) {
    if (mass.is_fixed && moves(mass)) {
      mass.kind = MassKind::ground;
      mass.is_mode = false;
    }
  }
  return held;
}

}  // namespace

bool is_linear(const Network& network) {
  for (std::uint32_t i = 0; i < network.masses.size(); ++i) {
    if (is_live_place(network, i)) {
      return false;
    }
  }
  return std::ranges::all_of(network.links, [](const Link& link) { return is_linear(link.law); });
}

double scheme_frequency_hz(double stiffness, double damping, double rate_hz) {
  const double z = std::clamp(damping, 0.0, 0.999);
  const double cosine = (2.0 - stiffness - z) / (2.0 * std::sqrt(1.0 - z));
  return rate_hz / (2.0 * std::numbers::pi) * std::acos(std::clamp(cosine, -1.0, 1.0));
}

std::optional<LowestShapes> lowest_shapes(const Network& network,
                                          std::span<const double> parameters,
                                          const Progress& progress) {
  const std::optional<Network> held = fixed_held(network);
  const Network& loose = held ? *held : network;
  const LinearSystem system = system_of(loose, parameters);
  const SparseMatrix stiffness = system.stiffness();
  double stiffest = 0.0;
  for (const double value : stiffness.value) {
    stiffest = std::max(stiffest, std::fabs(value));
  }
  if (!std::isfinite(stiffest) || stiffest == 0.0) {
    return std::nullopt;
  }
  // The shift is slightly below 0, so that networks with rigid motions can be factored, too.
  Spectrum spectrum(stiffness, -1e3 * rigid * stiffest, progress);
  const std::optional<Lowest> lowest =
      lowest_pairs(spectrum, stiffness, stiffest, static_cast<int>(most_shapes));
  if (!lowest) {
    return std::nullopt;
  }
  LowestShapes found;
  std::vector<Vector> shapes = shapes_of(loose, system, *lowest, spectrum);
  found.share_of_modes = share_of_modes(loose, system, shapes.front());
  const LinearSystem whole = held ? system_of(network, parameters) : system;
  if (held) {
    for (Vector& shape : shapes) {
      shape = lifted(whole, system, shape);
    }
    const std::vector<Vector> fixed = fixed_shapes(network, whole);
    shapes.insert(shapes.end(), fixed.begin(), fixed.end());
  }
  Projections projected = project(network, whole, shapes);
  found.stiffness = std::move(projected.stiffness);
  found.damping = std::move(projected.damping);
  found.fixed = std::move(projected.fixed);
  found.mode.stiffness = lowest->pairs.values[lowest->first];
  found.mode.damping = found.damping(0, 0);
  found.mode.frequency_hz =
      scheme_frequency_hz(found.mode.stiffness, found.mode.damping, Network::reference_rate_hz);
  return found;
}

}  // namespace ressort::analysis
