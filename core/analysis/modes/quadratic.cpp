#include "core/analysis/modes/quadratic.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/linear_algebra/eigen.h"

namespace ressort::analysis {
namespace {

using Complex = std::complex<double>;

// Tolerance per row, relative to the largest element, for shared eigenvectors.
constexpr double shared = 1e-12;
constexpr double alike = 1e-9;  // Poles that differ by less count as degenerate.

Complex form(const ComplexVector& a, const Matrix& matrix, const ComplexVector& b) {
  Complex sum;
  for (std::size_t column = 0; column < b.size(); ++column) {
    Complex along;
    for (std::size_t row = 0; row < a.size(); ++row) {
      along += matrix(row, column) * a[row];
    }
    sum += along * b[column];
  }
  return sum;
}

// Returns the eigenvalues of the matrix in this basis, if its vectors are eigenvectors.
std::optional<Vector> eigenvalues_in(const Matrix& matrix, const Matrix& basis, double most_left) {
  const Matrix pulled = product(matrix, basis);
  Vector values(basis.columns());
  for (std::size_t i = 0; i < basis.columns(); ++i) {
    const Vector shape = basis.column(i);
    Vector left = pulled.column(i);
    values[i] = dot(shape, left);
    left -= values[i] * shape;
    if (!(dot(left, left) <= most_left * most_left)) {
      return std::nullopt;
    }
  }
  return values;
}

class Quadratic {
 public:
  Quadratic(const Matrix& stiffness, const Matrix& damping, double e, double rigid)
      : stiffness_(stiffness),
        damping_(damping),
        e_(e),
        rigid_(rigid),
        stiffest_(largest(stiffness.values)),
        size_(stiffness.rows()) {}

  std::optional<Swings> solve(bool may_cross) {
    if (auto found = in_shared_vectors()) {
      return found;
    }
    auto found = may_cross ? crossed() : std::nullopt;
    return found ? std::optional(Swings{*std::move(found), false, {}}) : std::nullopt;
  }

 private:
  // Solves the case in which K and Z share their eigenvectors. The eigenvectors of a weighted sum
  // of both are then eigenvectors of each, even if one of them is degenerate.
  std::optional<Swings> in_shared_vectors() const {
    const double damped = largest(damping_.values);
    Matrix both = stiffness_;
    if (damped > 0.0) {
      both.values += 0.7346 * (stiffest_ > 0.0 ? stiffest_ / damped : 1.0) * damping_.values;
    }
    Swings found{.basis = symmetric_eigenpairs(both).vectors};
    const double share = shared_tolerance(size_);
    const auto k = eigenvalues_in(stiffness_, found.basis, share * stiffest_);
    const auto z = k ? eigenvalues_in(damping_, found.basis, share * damped) : std::nullopt;
    if (!z) {
      return std::nullopt;
    }
    for (std::size_t i = 0; i < size_; ++i) {
      if (const auto mu = swing_root((*k)[i], (*z)[i], e_, rigid_)) {
        Swing& swing = found.all.emplace_back(Swing{*mu, ComplexVector(size_)});
        for (std::size_t row = 0; row < size_; ++row) {
          swing.shape[row] = found.basis(row, i);
        }
      }
    }
    return found;
  }

  // Solves the general case as a first-order system in (x, v).
  std::optional<std::vector<Swing>> crossed() const {
    Matrix step(2 * size_, 2 * size_);
    for (std::size_t j = 0; j < size_; ++j) {
      for (std::size_t i = 0; i < size_; ++i) {
        const double one = i == j ? 1.0 : 0.0;
        step(i, j) = -e_ * stiffness_(i, j);
        step(i, size_ + j) = one - e_ * damping_(i, j);
        step(size_ + i, j) = -stiffness_(i, j);
        step(size_ + i, size_ + j) = -damping_(i, j);
      }
    }
    const auto pairs = eigenpairs(step);
    if (!pairs) {
      return std::nullopt;
    }
    std::vector<Swing> swings;
    for (std::size_t i = 0; i < pairs->values.size(); ++i) {
      const Complex mu = pairs->values[i];
      if (mu.imag() > 0.0 && std::norm(mu) > rigid_) {
        ComplexVector shape = pairs->vectors[i][std::slice(0, size_, 1)];
        swings.push_back({mu, ComplexVector(shape / Complex(length(shape)))});
      }
    }
    part_alike(swings);
    return swings;
  }

  // Returns a^T (2 mu + e K + Z) b.
  Complex product(Complex mu, const ComplexVector& a, const ComplexVector& b) const {
    return 2.0 * mu * Complex((a * b).sum()) + e_ * form(a, stiffness_, b) + form(a, damping_, b);
  }

  // Modes with equal poles may be mixed arbitrarily. This orthogonalises them, scales each, and
  // improves its mu from its shape.
  void part_alike(std::vector<Swing>& swings) const {
    std::ranges::sort(swings,
                      [](const Swing& a, const Swing& b) { return a.mu.imag() < b.mu.imag(); });
    for (std::size_t first = 0; first < swings.size();) {
      std::size_t end = first + 1;
      while (end < swings.size() &&
             std::abs(swings[end].mu - swings[first].mu) < alike * std::abs(swings[first].mu)) {
        ++end;
      }
      for (std::size_t i = first; i < end; ++i) {
        bring_forward(swings, i, end);
        refine(swings[i]);
        scale(swings[i]);
        for (std::size_t j = i + 1; j < end; ++j) {
          const Complex mu = swings[i].mu;
          const Complex of = product(mu, swings[i].shape, swings[i].shape);
          swings[j].shape -= product(mu, swings[i].shape, swings[j].shape) / of * swings[i].shape;
        }
      }
      first = end;
    }
  }

  // Moves the shape with the largest product with itself to the front; a sum of two if all are
  // self-orthogonal.
  void bring_forward(std::vector<Swing>& swings, std::size_t i, std::size_t end) const {
    if (i + 1 == end) {
      return;
    }
    const auto own = [&](const Swing& swing) {
      const double size = length(swing.shape);
      return std::abs(product(swing.mu, swing.shape, swing.shape)) / (size * size);
    };
    const auto at = static_cast<std::ptrdiff_t>(i);
    const auto best =
        std::max_element(swings.begin() + at, swings.begin() + static_cast<std::ptrdiff_t>(end),
                         [&](const Swing& a, const Swing& b) { return own(a) < own(b); });
    std::iter_swap(swings.begin() + at, best);
    for (std::size_t j = i + 1; j < end; ++j) {
      Swing sum{swings[i].mu, ComplexVector(swings[i].shape + swings[j].shape)};
      if (own(sum) > 1e3 * own(swings[i])) {
        swings[i].shape = sum.shape;
      }
    }
  }

  // Solves mu^2 a + mu (z + e k) + k = 0 for the shape (Rayleigh quotient, stationary at an
  // eigenvector).
  void refine(Swing& swing) const {
    const Complex a = (swing.shape * swing.shape).sum();
    const Complex k = form(swing.shape, stiffness_, swing.shape);
    const Complex z = form(swing.shape, damping_, swing.shape);
    for (int i = 0; i < 2; ++i) {
      const Complex slope = 2.0 * swing.mu * a + z + e_ * k;
      const Complex off = swing.mu * swing.mu * a + swing.mu * (z + e_ * k) + k;
      const Complex better = swing.mu - off / slope;
      if (!(std::abs(better - swing.mu) < 1e-6 * std::abs(swing.mu))) {
        return;  // Nearly critically damped: the quotient is too inaccurate.
      }
      swing.mu = better;
    }
  }

  void scale(Swing& swing) const {
    const Complex is = product(swing.mu, swing.shape, swing.shape);
    swing.shape *= std::sqrt(Complex(0.0, 2.0 * swing.mu.imag()) / is);
  }

  const Matrix& stiffness_;
  const Matrix& damping_;
  double e_;
  double rigid_;
  double stiffest_;
  std::size_t size_;
};

}  // namespace

std::optional<Complex> swing_root(double k, double z, double e, double rigid) {
  const double p = 0.5 * (z + e * k);
  const double rest = k - p * p;
  return k > rigid && rest > 0.0 ? std::optional(Complex(-p, std::sqrt(rest))) : std::nullopt;
}

double shared_tolerance(std::size_t rows) {
  return shared * std::sqrt(static_cast<double>(rows));
}

std::optional<Swings> swings_of(const Matrix& stiffness, const Matrix& damping, double e,
                                double rigid, bool may_cross) {
  return Quadratic(stiffness, damping, e, rigid).solve(may_cross);
}

}  // namespace ressort::analysis
