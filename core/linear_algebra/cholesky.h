// core/linear_algebra: a sparse Cholesky factorisation that refuses matrices that would take too
// long. The work is Eigen's. [any thread but audio]
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "core/linear_algebra/matrix.h"
#include "core/progress.h"

namespace ressort::linear_algebra {

// A = L D L^T with a diagonal D. Rows are ordered by approximate minimum degree and not exchanged,
// so the caller checks the accuracy if D has negative elements.
class Cholesky {
 public:
  Cholesky();
  ~Cholesky();

  // Returns the limit on the multiplications of a factorisation with so many rows: twice what
  // playable meshes need, and for small matrices a fraction of a second whatever their pattern.
  static double most_work(std::size_t rows);

  // Finds the order and the pattern of L. Returns false if the factorisation would exceed the
  // limit; then no other member may be called. O(elements of L)
  bool analyze(const SparseMatrix& lower, const Progress& progress);

  // Factors a matrix with the analysed pattern. Returns false if a pivot is 0 or NaN.
  bool factor(const SparseMatrix& lower, const Progress& progress);

  // Returns the number of negative eigenvalues of the last matrix (Sylvester's law of inertia).
  // O(rows)
  std::size_t negative_pivots() const;

  // Returns the diagonal of the inverse of the last matrix (Takahashi 1973). Takes about as long as
  // a factorisation.
  std::vector<double> inverse_diagonal(const Progress& progress) const;

  // Solves A x = b in place with the last matrix that was factored.
  void solve(double* x) const;

 private:
  struct Factor;
  std::unique_ptr<Factor> factor_;
  std::size_t steps_ = 0;  // Number of steps reported to Progress.
};

}  // namespace ressort::linear_algebra
