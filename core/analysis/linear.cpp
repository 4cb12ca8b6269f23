#include "core/analysis/linear.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/linear_algebra/cholesky.h"
#include "core/linear_algebra/eigen.h"

namespace ressort {
namespace {

constexpr int dense_size = 64;      // below this a dense solver is faster and never fails
constexpr double rigid = 1e-12;     // a smaller share of the largest stiffness is rounding
constexpr double tolerance = 1e-8;  // of the largest stiffness, that a mode's force is off

// The linear part of a network: what moves, numbered anew, and what pulls at it.
class Body {
 public:
  Body(const Network& network, std::span<const double> parameters)
      : network_(network), index_(network.masses.size(), held) {
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

  // M^(-1/2) K M^(-1/2), its lower half.
  SparseMatrix stiffness() const {
    std::vector<double> diagonal(scale_.size());
    std::vector<SparseMatrix::Element> elements;
    elements.reserve(network_.links.size() + scale_.size());
    each_spring([&](int a, int b, double k, double) {
      for (const int i : {a, b}) {
        if (i != held) {
          diagonal[static_cast<std::size_t>(i)] += k * scale(i) * scale(i);
        }
      }
      if (a != held && b != held && k != 0.0) {
        elements.push_back({std::max(a, b), std::min(a, b), -k * scale(a) * scale(b)});
      }
    });
    for (int i = 0; i < size(); ++i) {
      elements.push_back({i, i, diagonal[static_cast<std::size_t>(i)]});
    }
    return {size(), elements};
  }

  // The share of Z in a vector of length 1.
  double damping(const Vector& shape) const {
    double sum = 0.0;
    const auto moved = [&](int i) {
      return i == held ? 0.0 : shape[static_cast<std::size_t>(i)] * scale(i);
    };
    each_spring([&](int a, int b, double, double z) {
      const double stretch = moved(a) - moved(b);
      sum += z * stretch * stretch;
    });
    return sum;
  }

 private:
  static constexpr int held = -1;

  int size() const { return static_cast<int>(scale_.size()); }
  double scale(int i) const { return scale_[static_cast<std::size_t>(i)]; }
  double value(ArgumentId id) const { return id == no_argument ? 0.0 : values_[id]; }

  // Calls use(one end, the other, k, z).
  template <class Use>
  void each_spring(Use&& use) const {
    for (std::size_t i = 0; i < index_.size(); ++i) {
      const Mass& mass = network_.masses[i];
      if (mass.kind == MassKind::oscillator) {
        use(index_[i], held, value(mass.stiffness), value(mass.damping));
      }
    }
    for (const Link& link : network_.links) {
      if (link.a != link.b) {
        const LinearPart part = linear_part(link);
        use(index_[link.a], index_[link.b], value(part.stiffness), value(part.damping));
      }
    }
  }

  const Network& network_;
  std::vector<double> values_;  // [argument]
  std::vector<int> index_;      // [mass] among those that move, or held
  std::vector<double> scale_;   // [moving mass] M^(-1/2)
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

Matrix dense(const SparseMatrix& lower) {
  const auto size = static_cast<std::size_t>(lower.size());
  Matrix matrix(size, size);
  each_element(lower, [&](std::size_t i, std::size_t j, double value) { matrix(i, j) = value; });
  return matrix;
}

// Factored without a better row for a small pivot, a matrix that is not positive definite may have
// lost its digits: whether A x is value x all the same.
bool is_pair(const SparseMatrix& lower, double value, const Vector& vector, double most) {
  Vector left = -value * vector;
  each_element(lower, [&](std::size_t i, std::size_t j, double element) {
    left[i] += element * vector[j];
    left[j] += i == j ? 0.0 : element * vector[i];
  });
  return largest(left) <= most;
}

// Eigenpairs from 0 on, as many as asked for; all where the matrix is small.
class Spectrum {
 public:
  // The shift lies a little below 0, so that free networks can be factored too.
  Spectrum(const SparseMatrix& lower, double shift, const Progress& progress)
      : lower_(lower), shift_(shift), progress_(progress) {}

  std::optional<Eigenpairs> near_zero(int count) {
    if (lower_.size() <= dense_size) {
      return symmetric_eigenpairs(dense(lower_));
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

 private:
  bool factor() {
    SparseMatrix shifted = lower_;
    for (std::size_t k = 0; k + 1 < lower_.first.size(); ++k) {
      shifted.value[static_cast<std::size_t>(lower_.first[k])] -= shift_;
    }
    is_factored_ = factor_.analyze(lower_, progress_) &&
                   factor_.factor(shifted, Cholesky::Pivots::any, progress_);
    return is_factored_;
  }

  const SparseMatrix& lower_;
  double shift_;
  const Progress& progress_;
  Cholesky factor_;
  bool is_factored_ = false;
};

// The lowest eigenpair above what is rounding. Most often it is the first.
bool lowest_pair(const SparseMatrix& lower, double stiffest, const Progress& progress, Mode& mode,
                 Vector& shape) {
  const double floor = rigid * stiffest;
  Spectrum spectrum(lower, -1e3 * floor, progress);
  for (const int count : {1, 6}) {
    const std::optional<Eigenpairs> pairs = spectrum.near_zero(count);
    if (!pairs) {
      return false;
    }
    const auto above = std::find_if(std::begin(pairs->values), std::end(pairs->values),
                                    [&](double value) { return value > floor; });
    if (above != std::end(pairs->values)) {
      mode.stiffness = *above;
      shape = pairs->vectors.column(static_cast<std::size_t>(above - std::begin(pairs->values)));
      return is_pair(lower, mode.stiffness, shape, tolerance * stiffest);
    }
  }
  return false;
}

}  // namespace

double scheme_frequency_hz(double stiffness, double damping, double rate_hz) {
  const double z = std::clamp(damping, 0.0, 0.999);
  const double cosine = (2.0 - stiffness - z) / (2.0 * std::sqrt(1.0 - z));
  return rate_hz / (2.0 * std::numbers::pi) * std::acos(std::clamp(cosine, -1.0, 1.0));
}

std::optional<Mode> lowest_mode(const Network& network, std::span<const double> parameters,
                                const Progress& progress) {
  const Body body(network, parameters);
  const SparseMatrix stiffness = body.stiffness();
  double stiffest = 0.0;
  for (const double value : stiffness.value) {
    stiffest = std::max(stiffest, std::fabs(value));
  }
  Mode mode;
  Vector shape;
  if (!std::isfinite(stiffest) || stiffest == 0.0 ||
      !lowest_pair(stiffness, stiffest, progress, mode, shape)) {
    return std::nullopt;
  }
  mode.damping = body.damping(shape);
  mode.frequency_hz = scheme_frequency_hz(mode.stiffness, mode.damping, Network::reference_rate_hz);
  return mode;
}

}  // namespace ressort
