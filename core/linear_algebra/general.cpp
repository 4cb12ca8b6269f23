#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>

#include "core/linear_algebra/eigen.h"

namespace ressort::linear_algebra {
namespace {

constexpr double tolerance = 1e-9;  // Largest relative residual of a solution.

Eigen::Map<const Eigen::MatrixXd> map_of(const Matrix& matrix) {
  return {std::begin(matrix.values), static_cast<Eigen::Index>(matrix.rows()),
          static_cast<Eigen::Index>(matrix.columns())};
}
Eigen::Map<const Eigen::VectorXd> map_of(const Vector& vector) {
  return {std::begin(vector), static_cast<Eigen::Index>(vector.size())};
}

Matrix matrix_of(const Eigen::MatrixXd& given) {
  Matrix matrix(static_cast<std::size_t>(given.rows()), static_cast<std::size_t>(given.cols()));
  std::copy_n(given.data(), given.size(), std::begin(matrix.values));
  return matrix;
}

}  // namespace

std::vector<std::complex<double>> eigenvalues(const Matrix& matrix) {
  const Eigen::EigenSolver<Eigen::MatrixXd> solver(map_of(matrix), false);
  if (solver.info() != Eigen::Success) {
    return {};
  }
  return {solver.eigenvalues().begin(), solver.eigenvalues().end()};
}

std::optional<ComplexEigenpairs> eigenpairs(const Matrix& matrix) {
  const Eigen::EigenSolver<Eigen::MatrixXd> solver(map_of(matrix));
  if (solver.info() != Eigen::Success) {
    return std::nullopt;
  }
  const Eigen::MatrixXcd vectors = solver.eigenvectors();
  const std::size_t size = matrix.rows();
  ComplexEigenpairs pairs{ComplexVector(solver.eigenvalues().data(), size), {}, {}};
  for (std::size_t j = 0; j < size; ++j) {
    pairs.vectors.emplace_back(vectors.data() + j * size, size);
  }
  return pairs;
}

std::optional<ComplexEigenpairs> eigenpairs_of_state(const Matrix& matrix, const Vector& state) {
  std::optional<ComplexEigenpairs> pairs = eigenpairs(matrix);
  if (!pairs) {
    return std::nullopt;
  }
  // A conjugate pair contributes through its real part and its imaginary part.
  const std::size_t size = matrix.rows();
  Matrix parts(size, size);
  for (std::size_t j = 0; j < size; ++j) {
    const bool is_second = pairs->values[j].imag() < 0.0;
    for (std::size_t i = 0; i < size; ++i) {
      const std::complex<double> number = pairs->vectors[j][i];
      parts(i, j) = is_second ? -number.imag() : number.real();
    }
  }
  const std::optional<Vector> shares = solution(parts, state);
  if (!shares) {
    return std::nullopt;
  }
  pairs->shares = ComplexVector(size);
  for (std::size_t j = 0; j < size; ++j) {
    if (pairs->values[j].imag() > 0.0) {
      pairs->shares[j] = {(*shares)[j] / 2.0, -(*shares)[j + 1] / 2.0};
      pairs->shares[j + 1] = std::conj(pairs->shares[j]);
      ++j;
    } else {
      pairs->shares[j] = (*shares)[j];
    }
  }
  return pairs;
}

Matrix product(const Matrix& a, const Matrix& b) {
  return matrix_of(map_of(a) * map_of(b));
}

Matrix in_basis(const Matrix& matrix, const Matrix& basis) {
  return matrix_of(map_of(basis).transpose() * map_of(matrix) * map_of(basis));
}

std::optional<Vector> solution(const Matrix& matrix, const Vector& b) {
  const Eigen::VectorXd x = map_of(matrix).colPivHouseholderQr().solve(map_of(b));
  if (!((map_of(matrix) * x - map_of(b)).norm() <= tolerance * (1e-300 + map_of(b).norm()))) {
    return std::nullopt;
  }
  return Vector(x.data(), b.size());
}

std::optional<Matrix> quotient(const Matrix& b, const Matrix& a) {
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> factor(map_of(a).transpose());
  return factor.isInvertible()
             ? std::optional(matrix_of(factor.solve(map_of(b).transpose()).transpose()))
             : std::nullopt;
}

}  // namespace ressort::linear_algebra
