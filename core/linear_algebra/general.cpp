#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>

#include "core/linear_algebra/eigen.h"

namespace ressort::linear_algebra {
namespace {

constexpr double tolerance = 1e-9;  // of what a solution shall give

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
  const auto size = static_cast<Eigen::Index>(matrix.rows());
  Eigen::MatrixXcd vectors(size, size);
  for (Eigen::Index j = 0; j < size; ++j) {
    std::copy_n(std::begin(pairs->vectors[static_cast<std::size_t>(j)]), size,
                vectors.col(j).data());
  }
  const Eigen::VectorXcd wanted = map_of(state).cast<std::complex<double>>();
  const Eigen::VectorXcd shares = Eigen::PartialPivLU<Eigen::MatrixXcd>(vectors).solve(wanted);
  if (!((vectors * shares - wanted).norm() <= tolerance * (1e-300 + wanted.norm()))) {
    return std::nullopt;
  }
  pairs->shares = ComplexVector(shares.data(), matrix.rows());
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
  const Eigen::FullPivLU<Eigen::MatrixXd> inverse(map_of(a));
  return inverse.isInvertible() ? std::optional(matrix_of(map_of(b) * inverse.inverse()))
                                : std::nullopt;
}

}  // namespace ressort::linear_algebra
