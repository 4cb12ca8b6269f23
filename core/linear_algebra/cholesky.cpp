#include "core/linear_algebra/cholesky.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <new>

namespace ressort::linear_algebra {
namespace {

// The ordering of so many elements takes about a second.
constexpr std::size_t most_elements = 500'000;

using Sparse = Eigen::SparseMatrix<double>;

Sparse sparse_of(const SparseMatrix& lower) {
  return Eigen::Map<const Sparse>(lower.size(), lower.size(), lower.first.back(),
                                  lower.first.data(), lower.row.data(), lower.value.data());
}

}  // namespace

struct Cholesky::Factor : Eigen::SimplicialLDLT<Sparse> {
  // Returns the multiplications of a factorisation with the analysed pattern.
  double work() const {
    const Eigen::ArrayXd below = m_nonZerosPerCol.cast<double>().array();
    return (below * (below + 2.0)).sum();
  }
};

Cholesky::Cholesky() = default;
Cholesky::~Cholesky() = default;

double Cholesky::most_work(std::size_t rows) {
  const auto n = static_cast<double>(rows);
  return std::max(2e8, 1000.0 * n * std::log2(n + 1.0));
}

bool Cholesky::analyze(const SparseMatrix& lower, const Progress& progress) {
  if (lower.value.size() > most_elements) {
    return false;
  }
  factor_ = std::make_unique<Factor>();
  try {
    factor_->analyzePattern(sparse_of(lower));
  } catch (const std::bad_alloc&) {  // Eigen allocates L before the work is known.
    return false;
  }
  progress.spend(2 * lower.value.size());
  const double work = factor_->work();
  // Counts multiplications as an eighth of a step each.
  steps_ = lower.first.size() + static_cast<std::size_t>(work / 8.0);
  return work <= most_work(lower.first.size() - 1);
}

bool Cholesky::factor(const SparseMatrix& lower, const Progress& progress) {
  factor_->factorize(sparse_of(lower));
  progress.spend(steps_);
  return factor_->info() == Eigen::Success && !factor_->vectorD().hasNaN();
}

std::size_t Cholesky::negative_pivots() const {
  return static_cast<std::size_t>((factor_->vectorD().array() < 0.0).count());
}

// Computes the inverse Z where L is not 0, from the last column to the first (Takahashi):
//  Z_ij = -sum over k of Z_ik L_kj,  Z_jj = 1 / D_j - sum over k of L_kj Z_kj
// with k over the rows of column j of L below the diagonal. All pairs of such rows are nonzero
// places of L, too.
std::vector<double> Cholesky::inverse_diagonal(const Progress& progress) const {
  const Sparse& l = factor_->matrixL().nestedExpression();
  const int* const first = l.outerIndexPtr();
  const int* const row = l.innerIndexPtr();
  const double* const value = l.valuePtr();
  Eigen::VectorXd diagonal = factor_->vectorD().cwiseInverse();
  Eigen::VectorXd inverse(l.nonZeros());
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(l.rows());             // [row i] Sum of Z_ik L_kj.
  Eigen::VectorXd below(l.rows());                                   // [row] Column j of L.
  Eigen::VectorXi column = Eigen::VectorXi::Constant(l.rows(), -1);  // [row] Last j of `below`.
  for (int j = static_cast<int>(l.cols()); j-- > 0;) {
    for (int p = first[j]; p < first[j + 1]; ++p) {
      below[row[p]] = value[p];
      column[row[p]] = j;
    }
    for (int p = first[j]; p < first[j + 1]; ++p) {
      const int k = row[p];
      double own = diagonal[k] * value[p];
      for (int q = first[k]; q < first[k + 1]; ++q) {
        if (column[row[q]] == j) {
          sum[row[q]] += inverse[q] * value[p];
          own += inverse[q] * below[row[q]];
        }
      }
      sum[k] += own;
    }
    for (int p = first[j]; p < first[j + 1]; ++p) {
      inverse[p] = -sum[row[p]];
      sum[row[p]] = 0.0;
      diagonal[j] -= value[p] * inverse[p];
    }
  }
  progress.spend(steps_);
  diagonal = factor_->permutationPinv() * diagonal;
  return {diagonal.begin(), diagonal.end()};
}

void Cholesky::solve(double* x) const {
  Eigen::Map<Eigen::VectorXd> b(x, factor_->rows());
  b = factor_->solve(b);
}

}  // namespace ressort::linear_algebra
