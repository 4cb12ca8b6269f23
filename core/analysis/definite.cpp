#include "core/analysis/definite.h"

#include <algorithm>
#include <cassert>
#include <limits>
#include <map>

#include "core/groups.h"
#include "core/linear_algebra/cholesky.h"

namespace ressort::analysis {
namespace {

// Calls `use(row, column, share)` for the elements of a term in the lower triangle.
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
  std::vector<std::size_t> slots;  // [pair of a term] Its index among the elements.
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
  return matrix_->solver.factor(matrix_->sum, progress_) && matrix_->solver.negative_pivots() == 0;
}

// Let A be the matrix without the moving terms. Then A - sum w g g^T is positive definite if the
// matrix of sqrt(w_i w_j) g_i^T A^-1 g_j has a norm below 1 (Schur complement). Let c be the
// largest g^T A^-1 g over all positions of an end, including those between two nodes. Every |g_i^T
// A^-1 g_j| is at most sqrt(c_i c_j), and it is 0 between parts, so the norm is at most the largest
// sum of w c within a part.
Definite::Wandering Definite::test_moving_ends(std::span<const double> diagonal,
                                               std::span<const double> weights) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  std::vector<double> rest(weights.begin(), weights.end());
  for (std::size_t t = 0; t < rest.size(); ++t) {
    rest[t] = assembly_.terms[t].wanders > 0 ? 0.0 : rest[t];
  }
  if (!factor(diagonal, rest)) {
    return {infinity, infinity};
  }
  if (part_.empty()) {
    find_parts();
  }
  struct End {
    double share = 0.0;  // w c.
    double scale = 1.0;
    std::uint32_t part = 0;
  };
  std::vector<End> ends(assembly_.wandering_ends);
  const std::vector<double> gives = matrix_->solver.inverse_diagonal(progress_);
  std::vector<double> x(diagonal.size());
  for (std::size_t t = 0; t < rest.size(); ++t) {
    const Assembly::Term& term = assembly_.terms[t];
    if (term.wanders == 0) {
      continue;
    }
    const auto entries = assembly_.of(term);
    double give = entries[0].share * entries[0].share * gives[entries[0].row];
    if (entries.size() > 1) {
      std::fill(x.begin(), x.end(), 0.0);
      for (const Assembly::Entry& entry : entries) {
        x[entry.row] = entry.share;
      }
      solve(x);
      give = 0.0;
      for (const Assembly::Entry& entry : entries) {
        give += entry.share * x[entry.row];
      }
      progress_.spend(entries.size());
    }
    End& end = ends[term.wanders - 1];
    end.share = std::max(end.share, weights[t] * give);
    end.scale = term.scale;
    end.part = part_[entries[0].row];
  }
  Wandering found;
  std::map<std::uint32_t, double> parts;
  for (const End& end : ends) {
    found.together = std::max(found.together, parts[end.part] += end.share);
    found.alone = std::max(found.alone, end.share / end.scale);
  }
  return found;
}

void Definite::find_parts() {
  constexpr std::uint32_t no_row = 0xffffffffu;
  Groups parts(assembly_.masses.size());
  // A moving end stays on one part, at whichever of its nodes it is.
  std::vector<std::uint32_t> first(assembly_.wandering_ends, no_row);
  for (const Assembly::Term& term : assembly_.terms) {
    const auto entries = assembly_.of(term);
    for (const Assembly::Entry& entry : entries) {
      parts.join(entry.row, entries[0].row);
    }
    if (term.wanders > 0) {
      std::uint32_t& row = first[term.wanders - 1];
      row = row == no_row ? entries[0].row : row;
      parts.join(entries[0].row, row);
    }
  }
  for (std::uint32_t row = 0; row < assembly_.masses.size(); ++row) {
    part_.push_back(parts.find(row));
  }
}

void Definite::solve(std::vector<double>& x) const {
  assert(matrix_);
  matrix_->solver.solve(x.data());
}

}  // namespace ressort::analysis
