// core/linear_algebra: a sparse Cholesky factorisation that can be stopped, and that refuses what
// would take too long.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "core/linear_algebra/matrix.h"
#include "core/progress.h"

namespace ressort::linear_algebra {

// A = L S LT with S diagonal, of 1 and -1: all 1 where A is positive definite. The rows are in the
// order that approximate minimum degree gives. [any thread but audio]
class Cholesky {
 public:
  enum class Pivots {
    positive,  // stops at the first that is not
    any,       // but 0: no row is exchanged for a better one, so that accuracy is to be checked
  };

  // Most multiplications of a factorisation of so many rows: what the meshes that people play take
  // twice, and a fraction of a second for small ones however they hang together.
  static double most_work(std::size_t rows);

  // Finds the order, and where L is not 0. False where that is too much: then nothing else may be
  // asked. O(elements of L).
  bool analyze(const SparseMatrix& lower, const Progress& progress);

  // Of a matrix with the same pattern; false where a pivot is not as it is asked for.
  bool factor(const SparseMatrix& lower, Pivots pivots, const Progress& progress);

  // How many eigenvalues of the last matrix are below 0 (Sylvester). O(rows)
  std::size_t negative_pivots() const;

  // The diagonal of the last matrix's inverse, where all its pivots are positive (Takahashi 1973).
  // About what a factorisation takes.
  std::vector<double> inverse_diagonal(const Progress& progress) const;

  // Solves A x = b in place, by the last matrix that could be factored.
  void solve(double* x) const;

 private:
  struct Upper {
    int row;
    std::size_t element;  // of the given matrix
  };

  void sort_elements(const SparseMatrix& lower);
  std::span<const Upper> column(std::size_t k) const;

  std::vector<int> order_;  // [row] where it goes
  std::vector<int> upper_first_;
  std::vector<Upper> upper_;
  std::vector<int> parent_;  // [column] the first row below its diagonal that is not 0
  std::vector<int> first_;   // [column] of its elements, the diagonal first; then their number
  std::vector<int> row_;     // [element]
  std::vector<double> value_;
  std::vector<double> sign_;  // [row] of S
};

}  // namespace ressort::linear_algebra
