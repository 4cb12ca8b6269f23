// core/linear_algebra: dense complex matrices and the operations that the project needs of them.
// Only complex.cpp includes Eigen for this. [any thread but audio]
#pragma once

#include <complex>
#include <cstddef>
#include <optional>
#include <vector>

#include "core/linear_algebra/matrix.h"

namespace ressort::linear_algebra {

// A matrix in column-major order.
struct ComplexMatrix {
  ComplexMatrix(std::size_t row_count, std::size_t column_count)
      : rows(row_count), columns(column_count), values(row_count * column_count) {}
  std::complex<double>& operator()(std::size_t row, std::size_t column) {
    return values[row + column * rows];
  }
  std::complex<double> operator()(std::size_t row, std::size_t column) const {
    return values[row + column * rows];
  }

  std::size_t rows;
  std::size_t columns;
  std::vector<std::complex<double>> values;
};

struct HermitianEigenpairs {
  Vector values;          // ascending
  ComplexMatrix vectors;  // [row, pair] Orthonormal.
};

// Returns the eigenvalues of a Hermitian matrix and the vectors of the `most` largest ones. Only
// the lower half of the matrix is read. O(size^3)
HermitianEigenpairs hermitian_eigenpairs(const ComplexMatrix& matrix, std::size_t most);

// Returns the eigenvalues of the square matrix X that minimises |U_up X - U_down| (least squares),
// where U_up is U without its last row and U_down is U without its first. Empty if they cannot be
// found. O(rows columns^2)
std::vector<std::complex<double>> shift_eigenvalues(const ComplexMatrix& basis);

// Returns the Schur complement of the first row and column: the scalar that remains after all
// others are eliminated. It is 0 if the matrix is singular with a null vector that involves the
// first row. O(size^3)
std::complex<double> schur_complement_of_first(ComplexMatrix matrix);

}  // namespace ressort::linear_algebra
