#include "core/analysis/definite.h"

#include <algorithm>
#include <cassert>

#include "core/analysis/cholesky.h"

namespace ressort {
namespace {

using Sparse = Cholesky::Matrix;

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
  Matrix(const Stencil& stencil, const Progress& progress) {
    const auto size = static_cast<int>(stencil.masses.size());
    std::vector<Eigen::Triplet<double>> triplets;
    for (int i = 0; i < size; ++i) {
      triplets.emplace_back(i, i, 0.0);
    }
    for (const Stencil::Term& term : stencil.terms) {
      each_pair(stencil.of(term),
                [&](int row, int column, double) { triplets.emplace_back(row, column, 0.0); });
      progress.spend(1);
    }
    sum.resize(size, size);
    sum.setFromTriplets(triplets.begin(), triplets.end());
    progress.spend(triplets.size());
    is_feasible = solver.analyze(sum, progress);
    if (!is_feasible) {
      return;
    }
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
  Cholesky solver;
  bool is_feasible = false;
};

Definite::Definite(const Stencil& stencil, Progress progress)
    : stencil_(stencil), progress_(std::move(progress)) {}
Definite::~Definite() = default;

bool Definite::is_feasible() {
  if (!matrix_) {
    matrix_ = std::make_unique<Matrix>(stencil_, progress_);
  }
  return matrix_->is_feasible;
}

bool Definite::factor(std::span<const double> diagonal, std::span<const double> weights) {
  [[maybe_unused]] const bool can = is_feasible();
  assert(can);
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
  progress_.spend(weights.size());
  return matrix_->solver.factor(matrix_->sum, progress_);
}

void Definite::solve(std::vector<double>& x) const {
  assert(matrix_);
  matrix_->solver.solve(x.data());
}

}  // namespace ressort
