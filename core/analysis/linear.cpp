#include "core/analysis/linear.h"

#include <Spectra/MatOp/SparseSymShiftSolve.h>
#include <Spectra/SymEigsShiftSolver.h>
#include <Eigen/Dense>
#include <Eigen/Sparse>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "core/analysis/cholesky.h"

namespace ressort {
namespace {

using Sparse = Cholesky::Matrix;
using Vector = Eigen::VectorXd;

constexpr int dense_size = 64;  // below this a dense solver is faster and never fails
constexpr Eigen::Index most_general_masses = 20'000;  // their factorisation cannot be stopped
constexpr double rigid = 1e-12;  // a smaller share of the largest stiffness is rounding

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
  Sparse stiffness() const {
    Vector diagonal = Vector::Zero(size());
    std::vector<Eigen::Triplet<double>> entries;
    entries.reserve(network_.links.size() + scale_.size());
    each_spring([&](int a, int b, double k, double) {
      for (const int i : {a, b}) {
        if (i != held) {
          diagonal[i] += k * scale(i) * scale(i);
        }
      }
      if (a != held && b != held && k != 0.0) {
        entries.emplace_back(std::max(a, b), std::min(a, b), -k * scale(a) * scale(b));
      }
    });
    for (int i = 0; i < size(); ++i) {
      entries.emplace_back(i, i, diagonal[i]);
    }
    Sparse matrix(size(), size());
    matrix.setFromTriplets(entries.begin(), entries.end());
    return matrix;
  }

  // The share of Z in a vector of length 1.
  double damping(const Vector& shape) const {
    double sum = 0.0;
    const auto moved = [&](int i) { return i == held ? 0.0 : shape[i] * scale(i); };
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

// (A - shift)^-1, as Spectra wants it, for a positive A - shift: half of what a general one takes.
class Inverse {
 public:
  using Scalar = double;
  Inverse(const Cholesky& factor, Eigen::Index size, const Progress& progress)
      : factor_(factor), size_(size), progress_(progress) {}
  Eigen::Index rows() const { return size_; }
  Eigen::Index cols() const { return size_; }
  void set_shift(double) {}  // it has been factored
  void perform_op(const double* from, double* to) const {
    std::copy_n(from, size_, to);
    factor_.solve(to);
    progress_.spend(static_cast<std::size_t>(4 * size_));
  }

 private:
  const Cholesky& factor_;
  Eigen::Index size_;
  const Progress& progress_;
};

// The same for negative stiffnesses.
class General : public Spectra::SparseSymShiftSolve<double> {
 public:
  General(const Sparse& lower, const Progress& progress)
      : Spectra::SparseSymShiftSolve<double>(lower), progress_(progress) {}
  void perform_op(const double* from, double* to) const {
    Spectra::SparseSymShiftSolve<double>::perform_op(from, to);
    progress_.spend(static_cast<std::size_t>(8 * rows()));
  }

 private:
  const Progress& progress_;
};

struct Pairs {
  Eigen::VectorXd values;  // ascending
  Eigen::MatrixXd vectors;
};

// The `count` eigenpairs nearest to `shift`, which lies a little below 0 so that free networks can
// be factored too.
template <class Shifted>
bool near_zero(Shifted shifted, double shift, int count, Pairs& pairs) {
  constexpr Eigen::Index most_numbers = 30'000'000;  // of the vectors of all rounds
  const int vectors = std::max(12, 4 * count);
  const Eigen::Index rounds =
      std::clamp<Eigen::Index>(most_numbers / (vectors * shifted.rows()), 10, 200);
  try {  // Spectra tells by exceptions what it cannot factor or iterate
    Spectra::SymEigsShiftSolver<Shifted> solver(shifted, count, vectors, shift);
    solver.init();
    solver.compute(Spectra::SortRule::LargestMagn, rounds, 1e-10, Spectra::SortRule::SmallestAlge);
    if (solver.info() != Spectra::CompInfo::Successful) {
      return false;
    }
    pairs = {solver.eigenvalues(), solver.eigenvectors()};
    return true;
  } catch (const std::logic_error&) {
    return false;
  } catch (const std::runtime_error&) {
    return false;
  }
}

// The lowest eigenpair above `floor`. Most often it is the first.
bool lowest_pair(const Sparse& lower, double floor, const Progress& progress, double& value,
                 Vector& vector) {
  const double shift = -1e3 * floor;
  Cholesky factor;
  bool is_positive = false;
  if (lower.rows() > dense_size) {
    if (!factor.analyze(lower, progress)) {
      return false;
    }
    Sparse shifted = lower;
    for (Eigen::Index k = 0; k < lower.rows(); ++k) {
      shifted.coeffRef(k, k) -= shift;
    }
    is_positive = factor.factor(shifted, progress);
    if (!is_positive && lower.rows() > most_general_masses) {
      return false;
    }
  }
  Pairs pairs;
  for (const int count : {1, 6}) {
    if (lower.rows() <= dense_size) {
      const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver{Eigen::MatrixXd(lower)};
      pairs = {solver.eigenvalues(), solver.eigenvectors()};
    } else if (!(is_positive
                     ? near_zero(Inverse(factor, lower.rows(), progress), shift, count, pairs)
                     : near_zero(General(lower, progress), shift, count, pairs))) {
      return false;
    }
    for (Eigen::Index i = 0; i < pairs.values.size(); ++i) {
      if (pairs.values[i] > floor) {
        value = pairs.values[i];
        vector = pairs.vectors.col(i);
        return true;
      }
    }
  }
  return false;
}

}  // namespace

std::optional<Mode> lowest_mode(const Network& network, std::span<const double> parameters,
                                const Progress& progress) {
  const Body body(network, parameters);
  const Sparse stiffness = body.stiffness();
  if (stiffness.rows() == 0) {
    return std::nullopt;
  }
  double largest = 0.0;
  for (int k = 0; k < stiffness.outerSize(); ++k) {
    for (Sparse::InnerIterator entry(stiffness, k); entry; ++entry) {
      largest = std::max(largest, std::fabs(entry.value()));
    }
  }
  Mode mode;
  Vector shape;
  if (!std::isfinite(largest) || largest == 0.0 ||
      !lowest_pair(stiffness, rigid * largest, progress, mode.stiffness, shape)) {
    return std::nullopt;
  }
  mode.damping = body.damping(shape);
  const double z = std::clamp(mode.damping, 0.0, 0.999);
  const double cosine = (2.0 - mode.stiffness - z) / (2.0 * std::sqrt(1.0 - z));
  mode.frequency_hz = Network::reference_rate_hz / (2.0 * std::numbers::pi) *
                      std::acos(std::clamp(cosine, -1.0, 1.0));
  return mode;
}

}  // namespace ressort
