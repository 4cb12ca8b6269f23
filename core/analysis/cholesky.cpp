#include "core/analysis/cholesky.h"

#include <algorithm>
#include <cmath>

namespace ressort {
namespace {

constexpr int no_parent = -1;
constexpr Eigen::Index most_elements = 500'000;  // whose order is found within a second

}  // namespace

double Cholesky::most_work(std::size_t rows) {
  const auto n = static_cast<double>(rows);
  return std::max(2e8, 1000.0 * n * std::log2(n + 1.0));
}

// Its upper triangle is what the algorithm reads, a column in any order.
Cholesky::Matrix Cholesky::ordered(const Matrix& lower) const {
  Matrix upper(lower.rows(), lower.cols());
  upper.selfadjointView<Eigen::Upper>() = lower.selfadjointView<Eigen::Lower>().twistedBy(order_);
  return upper;
}

// Row by row, up the elimination tree from every element of A.
bool Cholesky::analyze(const Matrix& lower, const Progress& progress) {
  if (lower.nonZeros() > most_elements) {
    return false;
  }
  const Matrix whole = lower.selfadjointView<Eigen::Lower>();
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> back;
  Eigen::AMDOrdering<int>()(whole, back);
  order_ = back.inverse();
  progress.spend(static_cast<std::size_t>(whole.nonZeros()));
  const Matrix upper = ordered(lower);
  const auto size = static_cast<std::size_t>(upper.rows());
  parent_.assign(size, no_parent);
  std::vector<int> seen(size);
  std::vector<int> count(size, 1);
  const double most = most_work(size);
  double work = 0.0;
  for (int k = 0; k < upper.cols(); ++k) {
    std::size_t steps = 1;
    seen[static_cast<std::size_t>(k)] = k;
    for (Matrix::InnerIterator entry(upper, k); entry; ++entry) {
      for (auto i = static_cast<std::size_t>(entry.row()); seen[i] != k;
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

bool Cholesky::factor(const Matrix& lower, const Progress& progress) {
  const Matrix upper = ordered(lower);
  const std::size_t size = parent_.size();
  std::vector<double> y(size, 0.0);
  std::vector<int> seen(size);
  std::vector<int> path(size);
  std::vector<int> pattern(size);  // columns of row k, in the order of the tree
  std::vector<int> next = first_;  // [column] where its next element goes
  for (int k = 0; k < upper.cols(); ++k) {
    const auto row = static_cast<std::size_t>(k);
    std::size_t top = size;
    seen[row] = k;
    for (Matrix::InnerIterator entry(upper, k); entry; ++entry) {
      auto i = static_cast<std::size_t>(entry.row());
      y[i] += entry.value();
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
      diagonal -= l * l;
      row_[end] = k;
      value_[end] = l;
      steps += end - first;
    }
    if (!(diagonal > 0.0)) {
      return false;
    }
    row_[static_cast<std::size_t>(next[row])] = k;
    value_[static_cast<std::size_t>(next[row]++)] = std::sqrt(diagonal);
    progress.spend(steps / 8 + 1);  // of the cheapest kind
  }
  return true;
}

void Cholesky::solve(double* x) const {
  const auto size = static_cast<Eigen::Index>(parent_.size());
  Eigen::Map<Eigen::VectorXd> given(x, size);
  Eigen::VectorXd y = order_ * given;
  for (Eigen::Index k = 0; k < size; ++k) {
    const auto first = static_cast<std::size_t>(first_[static_cast<std::size_t>(k)]);
    const auto end = static_cast<std::size_t>(first_[static_cast<std::size_t>(k) + 1]);
    y[k] /= value_[first];
    for (std::size_t p = first + 1; p < end; ++p) {
      y[row_[p]] -= value_[p] * y[k];
    }
  }
  for (Eigen::Index k = size; k-- > 0;) {
    const auto first = static_cast<std::size_t>(first_[static_cast<std::size_t>(k)]);
    const auto end = static_cast<std::size_t>(first_[static_cast<std::size_t>(k) + 1]);
    for (std::size_t p = first + 1; p < end; ++p) {
      y[k] -= value_[p] * y[row_[p]];
    }
    y[k] /= value_[first];
  }
  given = order_.inverse() * y;
}

}  // namespace ressort
