#include "core/analysis/modes/lowest_swings.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "core/analysis/modes/linear_system.h"
#include "core/linear_algebra/cholesky.h"
#include "core/linear_algebra/eigen.h"

namespace ressort::analysis {
namespace {

using Complex = std::complex<double>;

constexpr int most_rounds = 20;

ComplexVector product_of(const SparseMatrix& lower, const ComplexVector& x) {
  Vector re(x.size());
  Vector im(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) {
    re[i] = x[i].real();
    im[i] = x[i].imag();
  }
  re = product(lower, re);
  im = product(lower, im);
  ComplexVector y(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) {
    y[i] = {re[i], im[i]};
  }
  return y;
}

ComplexVector left_of(const SparseMatrix& stiffness, const SparseMatrix& damping, double e,
                      const Swing& swing) {
  ComplexVector left = swing.mu * swing.mu * swing.shape;
  left += (1.0 + e * swing.mu) * product_of(stiffness, swing.shape);
  left += swing.mu * product_of(damping, swing.shape);
  return left;
}

class LowestSwings {
 public:
  LowestSwings(const SparseMatrix& stiffness, const SparseMatrix& damping, double e, double rigid,
               const Progress& progress)
      : stiffness_(stiffness),
        damping_(damping),
        e_(e),
        rigid_(rigid),
        progress_(progress),
        size_(static_cast<std::size_t>(stiffness.size())) {
    for (const double value : stiffness.value) {
      stiffest_ = std::max(stiffest_, std::fabs(value));
    }
    // Below 0, so that networks with rigid motions can be factored, too.
    shift_ = -1e-9 * stiffest_;
  }

  Result<Swings> find(std::size_t count) {
    progress_.stage("factoring its springs");
    if (!factor_.analyze(stiffness_, progress_)) {
      return Error{
          "its masses are connected in too many ways: finding its modes would take too long"};
    }
    if (!factored(factor_, shift_)) {
      return Error{"the springs cannot be factored: is a stiffness below 0?"};
    }
    // Asks for more, because overdamped motions are among the lowest, too.
    for (std::size_t asked = count + count / 32 + 4;; asked *= 2) {
      asked = std::min(asked, size_ - 1);
      progress_.stage("finding the lowest modes");
      if (!find_shapes(asked)) {
        return Error{"the lowest modes were not found: the iteration does not converge"};
      }
      Result<Swings> swings = add_damping(count);
      if (!swings || swings->all.size() >= count || asked + 1 >= size_) {
        return swings;
      }
    }
  }

 private:
  bool factored(Cholesky& factor, double shift) const {
    SparseMatrix shifted = stiffness_;
    for (std::size_t k = 0; k < size_; ++k) {
      shifted.value[static_cast<std::size_t>(stiffness_.first[k])] -= shift;
    }
    return factor.factor(shifted, progress_);
  }

  Vector given(Vector vector) const {
    factor_.solve(std::begin(vector));
    progress_.spend(8 * size_);
    return vector;
  }

  void make_apart(Vector& vector) const {
    for (int round = 0; round < 2; ++round) {
      for (const Vector& other : basis_) {
        vector -= dot(other, vector) * other;
      }
    }
  }

  bool add(Vector vector) {
    const double before = std::sqrt(dot(vector, vector));
    make_apart(vector);
    const double after = std::sqrt(dot(vector, vector));
    if (!(after > 1e-8 * before)) {
      return false;
    }
    basis_.emplace_back(vector / after);
    return true;
  }

  // Finds the lowest undamped shapes. Lanczos finds only one of several degenerate shapes, so
  // missing ones are searched for in the orthogonal complement of those found.
  bool find_shapes(std::size_t count) {
    basis_.clear();
    std::size_t missing = count;
    for (int round = 0; round < most_rounds && missing > 0; ++round) {
      const std::vector<Vector> known = basis_;
      const std::size_t asked = std::min(missing + (round == 0 ? 0 : 2), size_ - 1 - known.size());
      const auto pairs = eigenpairs_near(shift_, static_cast<int>(asked), static_cast<int>(size_),
                                         [&](const double* from, double* to) {
                                           Vector x(from, size_);
                                           if (!known.empty()) {
                                             make_apart(x);
                                           }
                                           x = given(std::move(x));
                                           if (!known.empty()) {
                                             make_apart(x);
                                           }
                                           std::copy(std::begin(x), std::end(x), to);
                                         });
      if (!pairs) {
        return false;
      }
      for (std::size_t i = 0; i < pairs->vectors.columns(); ++i) {
        // One more inverse iteration removes the high-frequency error.
        add(given(pairs->vectors.column(i)));
      }
      const std::vector<double> values = sort_basis();
      missing = missing_below(values, count);
    }
    return missing == 0;
  }

  // Rotates the basis into shapes (Rayleigh-Ritz) and returns their stiffnesses.
  std::vector<double> sort_basis() {
    const Eigenpairs pairs = symmetric_eigenpairs(between(stiffness_));
    std::vector<Vector> turned;
    for (std::size_t j = 0; j < basis_.size(); ++j) {
      Vector& sum = turned.emplace_back(size_);
      for (std::size_t i = 0; i < basis_.size(); ++i) {
        sum += pairs.vectors(i, j) * basis_[i];
      }
    }
    basis_ = std::move(turned);
    return {std::begin(pairs.values), std::end(pairs.values)};
  }

  // Counts the eigenvalues below the largest gap by the inertia of K - k, and returns how many are
  // missing.
  std::size_t missing_below(const std::vector<double>& values, std::size_t count) {
    std::size_t place = std::min(count, values.size()) - 1;
    const double least_gap = 1e-7;
    while (place > 0 && values[place] - values[place - 1] < least_gap * values[place]) {
      --place;
    }
    if (place == 0) {
      return 0;
    }
    Cholesky counter;
    const double between = 0.5 * (values[place] + values[place - 1]);
    if (!counter.analyze(stiffness_, progress_) || !factored(counter, between)) {
      return 0;
    }
    const std::size_t there = counter.negative_pivots();
    return there > place ? there - place : 0;
  }

  Matrix between(const SparseMatrix& lower) const {
    Matrix out(basis_.size(), basis_.size());
    for (std::size_t j = 0; j < basis_.size(); ++j) {
      const Vector pulled = product(lower, basis_[j]);
      for (std::size_t i = 0; i <= j; ++i) {
        out(i, j) = out(j, i) = dot(basis_[i], pulled);
      }
      progress_.spend(size_ * (j + 8));
    }
    return out;
  }

  // Solves the damped problem in the basis and extends the basis by the residuals until they are
  // small enough.
  Result<Swings> add_damping(std::size_t count) {
    for (int round = 0;; ++round) {
      progress_.stage("computing the damped modes");
      auto swings = swings_of(between(stiffness_), between(damping_), e_, rigid_);
      if (!swings) {
        return Error{"the modes were not found: the iteration does not converge"};
      }
      std::ranges::sort(swings->all,
                        [](const Swing& a, const Swing& b) { return a.mu.imag() < b.mu.imag(); });
      swings->all.resize(std::min(swings->all.size(), count));
      swings->basis = {};  // The basis of the lowest shapes alone is not the full basis.
      bool is_right = true;
      const std::size_t rows = basis_.size();
      for (Swing& swing : swings->all) {
        swing.shape = unfolded(swing.shape, rows);
        const ComplexVector left = left_of(stiffness_, damping_, e_, swing);
        if (length(left) > swing_tolerance * std::norm(swing.mu) * length(swing.shape)) {
          is_right = false;
          correct(left);
        }
      }
      if (is_right || round == most_rounds || basis_.size() == rows ||
          basis_.size() > 8 * count + 400) {
        return *std::move(swings);
      }
    }
  }

  ComplexVector unfolded(const ComplexVector& shares, std::size_t rows) const {
    ComplexVector shape(size_);
    for (std::size_t i = 0; i < rows; ++i) {
      for (std::size_t row = 0; row < size_; ++row) {
        shape[row] += shares[i] * basis_[i][row];
      }
    }
    return shape;
  }

  void correct(const ComplexVector& left) {
    for (const bool is_real : {true, false}) {
      Vector part(size_);
      for (std::size_t i = 0; i < size_; ++i) {
        part[i] = is_real ? left[i].real() : left[i].imag();
      }
      if (largest(part) > 0.0) {
        add(given(std::move(part)));
      }
    }
  }

  const SparseMatrix& stiffness_;
  const SparseMatrix& damping_;
  double e_;
  double rigid_;
  const Progress& progress_;
  std::size_t size_;
  double stiffest_ = 0.0;
  double shift_ = 0.0;
  Cholesky factor_;
  std::vector<Vector> basis_;  // Orthonormal.
};

}  // namespace

Result<Swings> lowest_swings(const SparseMatrix& stiffness, const SparseMatrix& damping, double e,
                             double rigid, std::size_t count, const Progress& progress) {
  return LowestSwings(stiffness, damping, e, rigid, progress).find(count);
}

double residual(const SparseMatrix& stiffness, const SparseMatrix& damping, double e,
                const Swing& swing) {
  return length(left_of(stiffness, damping, e, swing)) /
         (std::norm(swing.mu) * length(swing.shape));
}

}  // namespace ressort::analysis
