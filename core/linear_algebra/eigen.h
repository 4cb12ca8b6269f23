// core/linear_algebra: Eigen's and Spectra's functions as plain functions, so that no
// other room includes those libraries. [any thread but audio]
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "core/linear_algebra/matrix.h"

namespace ressort::linear_algebra {

struct Eigenpairs {
  Vector values;   // ascending
  Matrix vectors;  // [row, pair] Orthonormal.
};

// Returns the eigenpairs of a symmetric matrix; only its lower half is read. O(size^3)
Eigenpairs symmetric_eigenpairs(const Matrix& matrix);

// Writes (A - shift I)^-1 `from` to `to`.
using ShiftedInverse = std::function<void(const double* from, double* to)>;

// Returns the `count` eigenpairs of a symmetric A nearest to `shift`, by Lanczos iteration with the
// shifted inverse. Empty if the iteration does not converge.
std::optional<Eigenpairs> eigenpairs_near(double shift, int count, int size,
                                          const ShiftedInverse& inverse);

// Returns the eigenvalues of a square matrix; empty if they cannot be found. O(size^3)
std::vector<std::complex<double>> eigenvalues(const Matrix& matrix);

struct ComplexEigenpairs {
  ComplexVector values;  // Complex values come in conjugate pairs.
  std::vector<ComplexVector> vectors;
};

// Returns the eigenpairs of a square matrix, vectors of length 1; empty if they cannot be found.
// O(size^3)
std::optional<ComplexEigenpairs> eigenpairs(const Matrix& matrix);

// Returns A B.
Matrix product(const Matrix& a, const Matrix& b);

// Returns B^T A B.
Matrix in_basis(const Matrix& matrix, const Matrix& basis);

// Solves A x = b; returns the solution of least norm if there are many, and nothing if the residual
// exceeds 1e-9 of b.
std::optional<Vector> solution(const Matrix& matrix, const Vector& b);

// Solves X A = B; empty if A is singular.
std::optional<Matrix> quotient(const Matrix& b, const Matrix& a);

// Solves A X = B for a symmetric positive definite A, whose lower half is read. A is first scaled
// to a unit diagonal. Empty if A is not positive definite. O(size^3)
std::optional<Matrix> positive_solution(const Matrix& a, const Matrix& b);

// Returns B^T A^-1 B likewise, in about half the time.
std::optional<Matrix> positive_form(const Matrix& a, const Matrix& b);

// Returns A^T B.
Matrix transposed_product(const Matrix& a, const Matrix& b);

}  // namespace ressort::linear_algebra
