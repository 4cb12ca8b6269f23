// core/analysis: a sparse Cholesky factorisation that can be stopped, and that refuses what would
// take too long.
#pragma once

#include <Eigen/Sparse>
#include <cstddef>
#include <vector>

#include "core/progress.h"

namespace ressort {

// A = L LT, with the rows in the order that approximate minimum degree gives. Of matrices whose
// lower triangle is given, with a whole diagonal. [any thread but audio]
class Cholesky {
 public:
  using Matrix = Eigen::SparseMatrix<double>;

  // Most multiplications of a factorisation of so many rows: what the meshes that people play take
  // twice, and a fraction of a second for small ones however they hang together.
  static double most_work(std::size_t rows);

  // Finds the order, and where L is not 0. False where that is too much: then nothing else may be
  // asked. O(elements of L).
  bool analyze(const Matrix& lower, const Progress& progress);

  // Of a matrix with the same pattern; false where it is not positive definite.
  bool factor(const Matrix& lower, const Progress& progress);

  // Solves A x = b in place, by the last matrix that factor() found positive definite.
  void solve(double* x) const;

 private:
  Matrix ordered(const Matrix& lower) const;

  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order_;
  std::vector<int> parent_;  // [column] the first row below its diagonal that is not 0
  std::vector<int> first_;   // [column] of its elements, the diagonal first; then their number
  std::vector<int> row_;     // [element]
  std::vector<double> value_;
};

}  // namespace ressort
