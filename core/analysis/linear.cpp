#include "core/analysis/linear.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

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

// The linear part of a network: the moving masses, numbered consecutively, and their springs.
class Body {
 public:
  Body(const Network& network, std::span<const double> parameters)
      : network_(network), parameters_(parameters), index_(network.masses.size(), held) {
    for (const Formula& formula : network.arguments) {
      values_.push_back(evaluate(formula, parameters));
    }
    for (std::size_t i = 0; i < network.masses.size(); ++i) {
      const Mass& mass = network.masses[i];
      if (moves(mass)) {
        index_[i] = static_cast<int>(scale_.size());
        scale_.push_back(1.0 / std::sqrt(value(mass.mass)));
      }
    }
  }

  int size() const { return static_cast<int>(scale_.size()); }

  // Extends a shape of the network whose fixed masses are held to a shape of the whole.
  Vector lifted(const Body& held, const Vector& shape) const {
    Vector all(scale_.size());
    for (std::size_t i = 0; i < index_.size(); ++i) {
      if (held.index_[i] != Body::held) {
        all[static_cast<std::size_t>(index_[i])] = shape[static_cast<std::size_t>(held.index_[i])];
      }
    }
    return all;
  }
  // Returns the fixed masses as unit shapes, at most `most` of them.
  std::vector<Vector> fixed_shapes(std::size_t most) const {
    std::vector<Vector> shapes;
    for (std::size_t i = 0; i < index_.size() && shapes.size() < most; ++i) {
      if (index_[i] != held && network_.masses[i].is_fixed) {
        shapes.emplace_back(scale_.size());
        shapes.back()[static_cast<std::size_t>(index_[i])] = 1.0;
      }
    }
    return shapes;
  }

  // Returns the share of a shape's motion that belongs to modes of bodies, 0 to 1.
  double share_of_modes(const Vector& shape) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < index_.size(); ++i) {
      if (network_.masses[i].is_mode) {
        const double part = shape[static_cast<std::size_t>(index_[i])];
        sum += part * part;
      }
    }
    return sum / dot(shape, shape);
  }

  // Returns M^(-1/2) K M^(-1/2), its lower triangle.
  SparseMatrix stiffness() const {
    std::vector<double> diagonal(scale_.size());
    std::vector<SparseMatrix::Element> elements;
    elements.reserve(network_.links.size() + scale_.size());
    each_spring([&](const Shares& shares, double k, double, bool) {
      for (std::size_t p = 0; p < shares.of.size(); ++p) {
        for (std::size_t q = 0; q <= p; ++q) {
          const auto [i, a] = shares.of[p];
          const auto [j, b] = shares.of[q];
          if (i == j) {
            diagonal[static_cast<std::size_t>(i)] += (p == q ? 1.0 : 2.0) * k * a * b;
          } else if (k != 0.0) {
            elements.push_back({std::max(i, j), std::min(i, j), k * a * b});
          }
        }
      }
    });
    for (int i = 0; i < size(); ++i) {
      elements.push_back({i, i, diagonal[static_cast<std::size_t>(i)]});
    }
    return {size(), elements};
  }

  // Returns M^(-1/2) Z M^(-1/2) times a vector.
  Vector damped(const Vector& vector) const {
    Vector sum(vector.size());
    each_spring([&](const Shares& shares, double, double z, bool) {
      const double force = z * shares.along(vector);
      for (const auto& [row, share] : shares.of) {
        sum[static_cast<std::size_t>(row)] += force * share;
      }
    });
    return sum;
  }

  // Projections on some vectors: the part of K that keys scale, Z, and the fixed part of K.
  struct Between {
    Matrix stiffness;
    Matrix damping;
    Matrix fixed;
  };
  Between between(const std::vector<Vector>& vectors) const {
    const std::size_t count = vectors.size();
    Between all{Matrix(count, count), Matrix(count, count), Matrix(count, count)};
    std::vector<double> stretch(count);
    each_spring([&](const Shares& shares, double k, double z, bool is_fixed) {
      Matrix& stiffness = is_fixed ? all.fixed : all.stiffness;
      Matrix& damping = all.damping;
      for (std::size_t i = 0; i < count; ++i) {
        stretch[i] = shares.along(vectors[i]);
        for (std::size_t j = 0; j <= i; ++j) {
          stiffness(i, j) = stiffness(j, i) += k * stretch[i] * stretch[j];
          damping(i, j) = damping(j, i) += z * stretch[i] * stretch[j];
        }
      }
    });
    return all;
  }

 private:
  static constexpr int held = -1;

  // A link's elongation as a sum over rows: two masses, the masses around a place, or the modes of
  // a body.
  struct Shares {
    double along(const Vector& vector) const {
      double sum = 0.0;
      for (const auto& [row, share] : of) {
        sum += share * vector[static_cast<std::size_t>(row)];
      }
      return sum;
    }

    std::vector<std::pair<int, double>> of;
  };

  double value(ArgumentId id) const { return id == no_argument ? 0.0 : values_[id]; }

  void hang(Shares& shares, std::uint32_t mass, double sign) const {
    each_share(
        network_, mass,
        [&](std::uint32_t i, double share) {
          if (index_[i] != held) {
            shares.of.emplace_back(index_[i],
                                   sign * share * scale_[static_cast<std::size_t>(index_[i])]);
          }
        },
        parameters_);
  }

  // Calls use(shares, k, z, is_fixed).
  template <class Use>
  void each_spring(Use&& use) const {
    Shares shares;
    for (std::uint32_t i = 0; i < index_.size(); ++i) {
      const Mass& mass = network_.masses[i];
      if (mass.kind == MassKind::oscillator) {
        shares.of.clear();
        hang(shares, i, 1.0);
        use(shares, value(mass.stiffness), value(mass.damping), mass.is_fixed);
      }
    }
    for (const Link& link : network_.links) {
      if (link.a != link.b) {
        const LinearPart part = linear_part(link);
        shares.of.clear();
        hang(shares, link.a, 1.0);
        hang(shares, link.b, -1.0);
        use(shares, value(part.stiffness), value(part.damping), link.is_fixed);
      }
    }
  }

  const Network& network_;
  std::span<const double> parameters_;
  std::vector<double> values_;  // [argument]
  std::vector<int> index_;      // [mass] Index among the moving masses, or held.
  std::vector<double> scale_;   // [moving mass] M^(-1/2).
};

// Calls use(row, column, value) for every element on and below the diagonal.
template <class Use>
void each_element(const SparseMatrix& lower, Use&& use) {
  for (std::size_t column = 0; column + 1 < lower.first.size(); ++column) {
    for (auto i = static_cast<std::size_t>(lower.first[column]);
         i < static_cast<std::size_t>(lower.first[column + 1]); ++i) {
      use(static_cast<std::size_t>(lower.row[i]), column, lower.value[i]);
    }
  }
}

// The factorisation does not pivot, so an indefinite matrix may lose digits. Returns whether A x is
// value x nevertheless.
bool is_pair(const SparseMatrix& lower, double value, const Vector& vector, double most) {
  Vector left = -value * vector;
  each_element(lower, [&](std::size_t i, std::size_t j, double element) {
    left[i] += element * vector[j];
    left[j] += i == j ? 0.0 : element * vector[i];
  });
  return largest(left) <= most;
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
std::vector<Vector> shapes_of(const Body& body, const Lowest& lowest, Spectrum& spectrum) {
  const auto& [pairs, first] = lowest;
  const std::size_t count = std::min(pairs.vectors.columns(), most_shapes);
  std::vector<Vector> alike;
  std::vector<Vector> others;
  for (std::size_t i = 0; i < std::max(count, first + 1); ++i) {
    const bool is_alike = i >= first && pairs.values[i] < pairs.values[first] * (1.0 + same);
    (is_alike ? alike : others).push_back(pairs.vectors.column(i));
  }
  const Matrix turn = symmetric_eigenpairs(body.between(alike).damping).vectors;
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
    const std::optional<Vector> given = spectrum.inverse(body.damped(shape));
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
  const Body whole(network, parameters);
  const std::optional<Network> still = fixed_held(network);
  const Body body(still ? *still : network, parameters);
  const SparseMatrix stiffness = body.stiffness();
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
  std::vector<Vector> shapes = shapes_of(body, *lowest, spectrum);
  found.share_of_modes = body.share_of_modes(shapes.front());
  if (still) {
    for (Vector& shape : shapes) {
      shape = whole.lifted(body, shape);
    }
    const std::vector<Vector> fixed = whole.fixed_shapes(most_fixed_shapes);
    shapes.insert(shapes.end(), fixed.begin(), fixed.end());
  }
  Body::Between between = whole.between(shapes);
  found.stiffness = std::move(between.stiffness);
  found.damping = std::move(between.damping);
  found.fixed = std::move(between.fixed);
  found.mode.stiffness = lowest->pairs.values[lowest->first];
  found.mode.damping = found.damping(0, 0);
  found.mode.frequency_hz =
      scheme_frequency_hz(found.mode.stiffness, found.mode.damping, Network::reference_rate_hz);
  return found;
}

}  // namespace ressort::analysis
