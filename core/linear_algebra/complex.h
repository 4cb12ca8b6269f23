// core/linear_algebra: dense matrices of complex numbers, and what is asked of them; complex.cpp
// alone includes the library. [any thread but audio]
#pragma once

#include <complex>
#include <cstddef>
#include <optional>
#include <vector>

#include "core/linear_algebra/matrix.h"

namespace ressort::linear_algebra {

// Column by column.
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
  ComplexMatrix vectors;  // [row, pair] each of length 1, orthogonal
};

// Of a Hermitian matrix, whose lower half is read. O(size^3)
HermitianEigenpairs hermitian_eigenpairs(const ComplexMatrix& matrix);

// The eigenvalues of the square X that makes U_up X nearest to U_down, where U_up is U without its
// last row and U_down is U without its first (least squares). None where they cannot be found.
// O(rows columns^2)
std::vector<std::complex<double>> shift_eigenvalues(const ComplexMatrix& basis);

// X of A X = B for a symmetric and positive definite A, whose lower half is read; first brought to
// a diagonal of ones. Nothing where A is not positive definite. O(size^3)
std::optional<Matrix> positive_solution(const Matrix& a, const Matrix& b);

// What is left at the first row and column once all others are eliminated: 0 where the matrix is
// singular by a motion that the first takes part in. O(size^3)
std::complex<double> schur_complement_of_first(ComplexMatrix matrix);

// AT B
Matrix transposed_product(const Matrix& a, const Matrix& b);

}  // namespace ressort::linear_algebra
