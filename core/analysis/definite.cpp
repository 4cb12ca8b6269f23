#include "core/analysis/definite.h"

#include <algorithm>
#include <cassert>

#include "core/linear_algebra/cholesky.h"

namespace ressort {
namespace {

// Calls `use(row, column, share)` for what a term has in the lower triangle.
template <class Use>
void each_pair(std::span<const Assembly::Entry> entries, Use&& use) {
  for (std::size_t i = 0; i < entries.size(); ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      const auto [low, high] = std::minmax(entries[i].row, entries[j].row);
      use(static_cast<int>(high), static_cast<int>(low), entries[i].share * entries[j].share);
    }
  }
}

}  // namespace

struct Definite::Matrix {
  Matrix(const Assembly& assembly, const Progress& progress)
      : sum(static_cast<int>(assembly.masses.size()), elements_of(assembly, progress)) {
    progress.spend(sum.value.size());
    is_feasible = solver.analyze(sum, progress);
    for (std::size_t t = 0; is_feasible && t < assembly.terms.size(); ++t) {
      each_pair(assembly.of(assembly.terms[t]),
                [&](int row, int column, double) { slots.push_back(sum.find(row, column)); });
    }
  }

  static std::vector<SparseMatrix::Element> elements_of(const Assembly& assembly,
                                                        const Progress& progress) {
    std::vector<SparseMatrix::Element> elements;
    for (const Assembly::Term& term : assembly.terms) {
      each_pair(assembly.of(term), [&](int row, int column, double) {
        elements.push_back({row, column, 0.0});
      });
      progress.spend(1);
    }
    progress.spend(elements.size());
    return elements;
  }

  SparseMatrix sum;
  std::vector<std::size_t> slots;  // [pair of a term] among its elements
  Cholesky solver;
  bool is_feasible = false;
};

Definite::Definite(const Assembly& assembly, Progress progress)
    : assembly_(assembly), progress_(std::move(progress)) {}
Definite::~Definite() = default;

bool Definite::is_feasible() {
  if (!matrix_) {
    matrix_ = std::make_unique<Matrix>(assembly_, progress_);
  }
  return matrix_->is_feasible;
}

bool Definite::factor(std::span<const double> diagonal, std::span<const double> weights) {
  [[maybe_unused]] const bool can = is_feasible();
  assert(can);
  std::vector<double>& values = matrix_->sum.value;
  std::fill(values.begin(), values.end(), 0.0);
  for (std::size_t i = 0; i < diagonal.size(); ++i) {
    values[static_cast<std::size_t>(matrix_->sum.first[i])] = diagonal[i];
  }
  const std::size_t* at = matrix_->slots.data();
  for (std::size_t t = 0; t < weights.size(); ++t) {
    each_pair(assembly_.of(assembly_.terms[t]),
              [&](int, int, double share) { values[*at++] -= weights[t] * share; });
  }
  progress_.spend(weights.size());
  return matrix_->solver.factor(matrix_->sum, Cholesky::Pivots::positive, progress_);
}

void Definite::solve(std::vector<double>& x) const {
  assert(matrix_);
  matrix_->solver.solve(x.data());
}

}  // namespace ressort
