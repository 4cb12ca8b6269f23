// core/linear_algebra: a sparse Cholesky factorisation that can be cancelled and that refuses
// matrices that would take too long.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "core/linear_algebra/matrix.h"
#include "core/progress.h"

namespace ressort::linear_algebra {

// A = L S L^T with a diagonal S of 1 and -1; S = I if A is positive definite. Rows are ordered by
// approximate minimum degree. [any thread but audio]
class Cholesky {
 public:
  enum class Pivots {
    positive,  // All pivots must be positive; stops at the first that is not.
    // Pivots may have any sign but not be 0. Rows are not exchanged, so the caller checks the
    // accuracy.
    any,
  };

  // Returns the limit on the multiplications of a factorisation with so many rows: twice what
  // playable meshes need, and for small matrices a fraction of a second whatever their pattern.
  static double most_work(std::size_t rows);

  // Finds the order and the pattern of L. Returns false if the factorisation would exceed the
  // limit; then no other member may be called. O(elements of L)
  bool analyze(const SparseMatrix& lower, const Progress& progress);

  // Factors a matrix with the analysed pattern. Returns false if a pivot violates `pivots`.
  bool factor(const SparseMatrix& lower, Pivots pivots, const Progress& progress);

  // Returns the number of negative eigenvalues of the last matrix (Sylvester's law of inertia).
  // O(rows)
  std::size_t negative_pivots() const;

  // Returns the diagonal of the inverse of the last matrix, whose pivots must all be positive
  // (Takahashi 1973). Takes about as long as a factorisation.
  std::vector<double> inverse_diagonal(const Progress& progress) const;

  // Solves A x = b in place with the last matrix that was factored.
  void solve(double* x) const;

 private:
  struct Upper {
    int row;
    std::size_t element;  // Element of the given matrix.
  };

  void sort_elements(const SparseMatrix& lower);
  std::span<const Upper> column(std::size_t k) const;

  std::vector<int> order_;  // [row] Its position in the elimination order.
  std::vector<int> upper_first_;
  std::vector<Upper> upper_;
  // [column] Parent in the elimination tree: the first nonzero row below the diagonal.
  std::vector<int> parent_;
  // [column] Index of its first element, which is the diagonal; then the number of elements.
  std::vector<int> first_;
  std::vector<int> row_;  // [element]
  std::vector<double> value_;
  std::vector<double> sign_;  // [row] of S
};

}  // namespace ressort::linear_algebra
