// core/linear_algebra: what the libraries Eigen and Spectra do for everybody else, as plain
// functions; symmetric.cpp and general.cpp alone include them. [any thread but audio]
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "core/linear_algebra/matrix.h"

namespace ressort::linear_algebra {

struct Eigenpairs {
  Vector values;   // ascending
  Matrix vectors;  // [row, pair] each of length 1, orthogonal
};

// Of a symmetric matrix, whose lower half is read. O(size^3)
Eigenpairs symmetric_eigenpairs(const Matrix& matrix);

// Writes (A - shift I)^-1 `from` to `to`.
using ShiftedInverse = std::function<void(const double* from, double* to)>;

// The `count` eigenpairs of a symmetric A nearest to `shift`, by Lanczos iterations of the inverse.
// Nothing where they do not converge.
std::optional<Eigenpairs> eigenpairs_near(double shift, int count, int size,
                                          const ShiftedInverse& inverse);

// An order of rows, by approximate minimum degree, in which few zeros fill up when a matrix with
// this pattern is factored: [row] where it goes. Does not look at the values.
std::vector<int> order_of_elimination(const SparseMatrix& pattern);

// Of any square matrix; none where they cannot be found. O(size^3)
std::vector<std::complex<double>> eigenvalues(const Matrix& matrix);

struct ComplexEigenpairs {
  ComplexVector values;  // complex ones in conjugate pairs
  std::vector<ComplexVector> vectors;
  ComplexVector shares;  // [pair] how much of each is in the state, if one is given
};

// Of any square matrix, each of length 1. Nothing where they cannot be found. O(size^3)
std::optional<ComplexEigenpairs> eigenpairs(const Matrix& matrix);

// Of any square matrix, and a state as the sum of shares * vectors. Nothing where the vectors do
// not span it to 1e-9. O(size^3)
std::optional<ComplexEigenpairs> eigenpairs_of_state(const Matrix& matrix, const Vector& state);

// A B
Matrix product(const Matrix& a, const Matrix& b);

// BT A B
Matrix in_basis(const Matrix& matrix, const Matrix& basis);

// x of A x = b, the smallest where there are many; nothing where there is none, to 1e-9 of b.
std::optional<Vector> solution(const Matrix& matrix, const Vector& b);

// X of X A = B; nothing where A is singular.
std::optional<Matrix> quotient(const Matrix& b, const Matrix& a);

}  // namespace ressort::linear_algebra
