#include "core/linear_algebra/cholesky.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "core/linear_algebra/eigen.h"

namespace ressort::linear_algebra {
namespace {

constexpr int no_parent = -1;
// The ordering of so many elements takes about a second.
constexpr std::size_t most_elements = 500'000;

}  // namespace

double Cholesky::most_work(std::size_t rows) {
  const auto n = static_cast<double>(rows);
  return std::max(2e8, 1000.0 * n * std::log2(n + 1.0));
}

// Collects the part of A above the diagonal in the new order, column by column; the elements of a
// column may have any order.
void Cholesky::sort_elements(const SparseMatrix& lower) {
  const auto place = [&](std::size_t i) { return order_[i]; };
  const std::size_t size = order_.size();
  const auto each = [&](auto&& use) {
    for (std::size_t column = 0; column < size; ++column) {
      for (int i = lower.first[column]; i < lower.first[column + 1]; ++i) {
        const auto element = static_cast<std::size_t>(i);
        const int a = place(static_cast<std::size_t>(lower.row[element]));
        const int b = place(column);
        use(element, std::min(a, b), static_cast<std::size_t>(std::max(a, b)));
      }
    }
  };
  upper_first_.assign(size + 1, 0);
  each([&](std::size_t, int, std::size_t column) { ++upper_first_[column + 1]; });
  std::partial_sum(upper_first_.begin(), upper_first_.end(), upper_first_.begin());
  std::vector<int> next = upper_first_;
  upper_.resize(lower.value.size());
  each([&](std::size_t element, int row, std::size_t column) {
    upper_[static_cast<std::size_t>(next[column]++)] = {row, element};
  });
}

std::span<const Cholesky::Upper> Cholesky::column(std::size_t k) const {
  return {upper_.data() + upper_first_[k], upper_.data() + upper_first_[k + 1]};
}

// Computes the pattern of L row by row, by walking up the elimination tree from every element of A
// (Davis 2006, "Direct Methods for Sparse Linear Systems").
bool Cholesky::analyze(const SparseMatrix& lower, const Progress& progress) {
  if (lower.value.size() > most_elements) {
    return false;
  }
  order_ = order_of_elimination(lower);
  progress.spend(2 * lower.value.size());
  sort_elements(lower);
  const std::size_t size = order_.size();
  parent_.assign(size, no_parent);
  std::vector<int> seen(size);
  std::vector<int> count(size, 1);
  const double most = most_work(size);
  double work = 0.0;
  for (int k = 0; k < lower.size(); ++k) {
    std::size_t steps = 1;
    seen[static_cast<std::size_t>(k)] = k;
    for (const Upper& entry : column(static_cast<std::size_t>(k))) {
      for (auto i = static_cast<std::size_t>(entry.row); seen[i] != k;
           i = static_cast<std::size_t>(parent_[i])) {
        parent_[i] = parent_[i] == no_parent ? k : parent_[i];
        work += 2.0 * count[i]++ + 1.0;
        seen[i] = k;
        ++steps;
      }
    }
    if (work > most) {
      return false;
    }
    progress.spend(steps);
  }
  first_.assign(size + 1, 0);
  for (std::size_t k = 0; k < size; ++k) {
    first_[k + 1] = first_[k] + count[k];
  }
  row_.resize(static_cast<std::size_t>(first_[size]));
  value_.resize(row_.size());
  return true;
}

bool Cholesky::factor(const SparseMatrix& lower, Pivots pivots, const Progress& progress) {
  const std::size_t size = parent_.size();
  std::vector<double> y(size, 0.0);
  std::vector<int> seen(size);
  std::vector<int> path(size);
  std::vector<int> pattern(size);  // Columns of row k, in topological order of the tree.
  std::vector<int> next = first_;  // [column] Position of its next element.
  sign_.assign(size, 1.0);
  for (int k = 0; k < lower.size(); ++k) {
    const auto row = static_cast<std::size_t>(k);
    std::size_t top = size;
    seen[row] = k;
    for (const Upper& entry : column(row)) {
      auto i = static_cast<std::size_t>(entry.row);
      y[i] += lower.value[entry.element];
      std::size_t length = 0;
      for (; seen[i] != k; i = static_cast<std::size_t>(parent_[i])) {
        path[length++] = static_cast<int>(i);
        seen[i] = k;
      }
      while (length > 0) {
        pattern[--top] = path[--length];
      }
    }
    double diagonal = std::exchange(y[row], 0.0);
    std::size_t steps = 1;
    for (; top < size; ++top) {
      const auto i = static_cast<std::size_t>(pattern[top]);
      const auto first = static_cast<std::size_t>(first_[i]);
      const auto end = static_cast<std::size_t>(next[i]++);
      const double l = std::exchange(y[i], 0.0) / value_[first];
      for (std::size_t p = first + 1; p < end; ++p) {
        y[static_cast<std::size_t>(row_[p])] -= value_[p] * l;
      }
      diagonal -= sign_[i] * l * l;
      row_[end] = k;
      value_[end] = sign_[i] * l;
      steps += end - first;
    }
    if (pivots == Pivots::any && diagonal < 0.0) {
      sign_[row] = -1.0;
      diagonal = -diagonal;
    }
    if (!(diagonal > 0.0)) {
      return false;
    }
    row_[static_cast<std::size_t>(next[row])] = k;
    value_[static_cast<std::size_t>(next[row]++)] = std::sqrt(diagonal);
    progress.spend(steps / 8 + 1);  // Counts multiplications as an eighth of a step each.
  }
  return true;
}

std::size_t Cholesky::negative_pivots() const {
  return static_cast<std::size_t>(std::count(sign_.begin(), sign_.end(), -1.0));
}

// Computes the inverse Z where L is not 0, from the last column to the first (Takahashi):
//  Z_ij = -sum over k of Z_ik L_kj / L_jj,  Z_jj = (1 / L_jj - sum over k of L_kj Z_kj) / L_jj
// with k over the rows of column j of L. All pairs of such rows are nonzero places of L, too.
std::vector<double> Cholesky::inverse_diagonal(const Progress& progress) const {
  const std::size_t size = order_.size();
  std::vector<double> inverse(value_.size());
  std::vector<double> sum(size, 0.0);    // [row] Sum of Z_ik L_kj.
  std::vector<double> below(size, 0.0);  // [row] Column j of L.
  for (std::size_t j = size; j-- > 0;) {
    const auto first = static_cast<std::size_t>(first_[j]);
    const auto end = static_cast<std::size_t>(first_[j + 1]);
    for (std::size_t p = first + 1; p < end; ++p) {
      below[static_cast<std::size_t>(row_[p])] = value_[p];
    }
    std::size_t steps = 1;
    for (std::size_t p = first + 1; p < end; ++p) {
      const auto k = static_cast<std::size_t>(row_[p]);
      const auto start = static_cast<std::size_t>(first_[k]);
      const auto stop = static_cast<std::size_t>(first_[k + 1]);
      double own = inverse[start] * value_[p];
      for (std::size_t q = start + 1; q < stop; ++q) {
        const auto i = static_cast<std::size_t>(row_[q]);
        // Rows outside column j are computed, too, but never read.
        sum[i] += inverse[q] * value_[p];
        own += inverse[q] * below[i];
      }
      sum[k] += own;
      steps += stop - start;
    }
    const double pivot = value_[first];
    double rest = 1.0 / pivot;
    for (std::size_t p = first + 1; p < end; ++p) {
      const auto k = static_cast<std::size_t>(row_[p]);
      inverse[p] = -sum[k] / pivot;
      rest -= value_[p] * inverse[p];
    }
    inverse[first] = rest / pivot;
    for (std::size_t p = first + 1; p < end; ++p) {
      const auto k = static_cast<std::size_t>(row_[p]);
      below[k] = 0.0;
      for (auto q = static_cast<std::size_t>(first_[k]);
           q < static_cast<std::size_t>(first_[k + 1]); ++q) {
        sum[static_cast<std::size_t>(row_[q])] = 0.0;
      }
    }
    progress.spend(steps / 8 + 1);
  }
  std::vector<double> diagonal(size);
  for (std::size_t i = 0; i < size; ++i) {
    diagonal[i] = inverse[static_cast<std::size_t>(first_[static_cast<std::size_t>(order_[i])])];
  }
  return diagonal;
}

void Cholesky::solve(double* x) const {
  const std::size_t size = order_.size();
  std::vector<double> y(size);
  for (std::size_t i = 0; i < size; ++i) {
    y[static_cast<std::size_t>(order_[i])] = x[i];
  }
  const auto below = [&](std::size_t k, auto&& use) {
    const auto end = static_cast<std::size_t>(first_[k + 1]);
    for (auto p = static_cast<std::size_t>(first_[k]) + 1; p < end; ++p) {
      use(value_[p], y[static_cast<std::size_t>(row_[p])]);
    }
  };
  for (std::size_t k = 0; k < size; ++k) {
    const double known = y[k] /= value_[static_cast<std::size_t>(first_[k])];
    below(k, [&](double l, double& later) { later -= l * known; });
  }
  for (std::size_t k = size; k-- > 0;) {
    double sum = sign_[k] * y[k];
    below(k, [&](double l, double known) { sum -= l * known; });
    y[k] = sum / value_[static_cast<std::size_t>(first_[k])];
  }
  for (std::size_t i = 0; i < size; ++i) {
    x[i] = y[static_cast<std::size_t>(order_[i])];
  }
}

}  // namespace ressort::linear_algebra
