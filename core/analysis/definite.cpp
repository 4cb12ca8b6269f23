#include "core/analysis/definite.h"

#include <Eigen/Sparse>
#include <algorithm>
#include <cassert>
#include <cmath>

namespace ressort {
namespace {

using Sparse = Eigen::SparseMatrix<double>;

// Calls `use(row, column, share)` for what a term has in the lower triangle.
template <class Use>
void each_pair(std::span<const Stencil::Entry> entries, Use&& use) {
  for (std::size_t i = 0; i < entries.size(); ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      const auto [low, high] = std::minmax(entries[i].row, entries[j].row);
      use(static_cast<int>(high), static_cast<int>(low), entries[i].share * entries[j].share);
    }
  }
}

}  // namespace

struct Definite::Matrix {
  explicit Matrix(const Stencil& stencil) {
    const auto size = static_cast<int>(stencil.masses.size());
    std::vector<Eigen::Triplet<double>> triplets;
    for (int i = 0; i < size; ++i) {
      triplets.emplace_back(i, i, 0.0);
    }
    for (const Stencil::Term& term : stencil.terms) {
      each_pair(stencil.of(term),
                [&](int row, int column, double) { triplets.emplace_back(row, column, 0.0); });
    }
    sum.resize(size, size);
    sum.setFromTriplets(triplets.begin(), triplets.end());
    solver.analyzePattern(sum);
    slots.reserve(triplets.size() - stencil.masses.size());
    for (std::size_t i = stencil.masses.size(); i < triplets.size(); ++i) {
      slots.push_back(slot(triplets[i].row(), triplets[i].col()));
    }
  }

  // Where an element is among the values; a column's first is its diagonal.
  int slot(int row, int column) const {
    const int* const inner = sum.innerIndexPtr();
    const int* const first = inner + sum.outerIndexPtr()[column];
    const int* const last = inner + sum.outerIndexPtr()[column + 1];
    return static_cast<int>(std::lower_bound(first, last, row) - inner);
  }

  Sparse sum;
  std::vector<int> slots;  // [pair of a term]
  Eigen::SimplicialLLT<Sparse, Eigen::Lower> solver;
};

Definite::Definite(const Stencil& stencil) : stencil_(stencil) {}
Definite::~Definite() = default;

bool Definite::factor(std::span<const double> diagonal, std::span<const double> weights) {
  if (!matrix_) {
    matrix_ = std::make_unique<Matrix>(stencil_);
  }
  double* const values = matrix_->sum.valuePtr();
  std::fill_n(values, matrix_->sum.nonZeros(), 0.0);
  for (std::size_t i = 0; i < diagonal.size(); ++i) {
    values[matrix_->sum.outerIndexPtr()[i]] = diagonal[i];
  }
  const int* at = matrix_->slots.data();
  for (std::size_t t = 0; t < weights.size(); ++t) {
    each_pair(stencil_.of(stencil_.terms[t]),
              [&](int, int, double share) { values[*at++] -= weights[t] * share; });
  }
  matrix_->solver.factorize(matrix_->sum);
  return matrix_->solver.info() == Eigen::Success;
}

void Definite::solve(std::vector<double>& x) const {
  assert(matrix_);
  Eigen::Map<Eigen::VectorXd> mapped(x.data(), static_cast<Eigen::Index>(x.size()));
  const Eigen::VectorXd solved = matrix_->solver.solve(mapped);
  mapped = solved;
}

}  // namespace ressort
