#include <Eigen/Cholesky>
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

// The Cholesky factor of a matrix that is scaled to a unit diagonal.
struct Factor {
  static std::optional<Factor> of(const Matrix& a) {
    const auto given = map_of(a);
    if (given.size() > 0 && !(given.diagonal().minCoeff() > 0.0)) {
      return std::nullopt;
    }
    Factor factor{given.diagonal().cwiseSqrt().cwiseInverse(), {}};
    factor.lower.compute(factor.scale.asDiagonal() * given * factor.scale.asDiagonal());
    return factor.lower.info() == Eigen::Success ? std::optional(factor) : std::nullopt;
  }

  Eigen::VectorXd scale;
  Eigen::LLT<Eigen::MatrixXd> lower;
};

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
  ComplexEigenpairs pairs{ComplexVector(solver.eigenvalues().data(), size), {}};
  for (std::size_t j = 0; j < size; ++j) {
    pairs.vectors.emplace_back(vectors.data() + j * size, size);
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

std::optional<Matrix> positive_solution(const Matrix& a, const Matrix& b) {
  const std::optional<Factor> factor = Factor::of(a);
  return factor
             ? std::optional(matrix_of(factor->scale.asDiagonal() *
                                       factor->lower.solve(factor->scale.asDiagonal() * map_of(b))))
             : std::nullopt;
}

std::optional<Matrix> positive_form(const Matrix& a, const Matrix& b) {
  const std::optional<Factor> factor = Factor::of(a);
  if (!factor) {
    return std::nullopt;
  }
  Eigen::MatrixXd half = factor->scale.asDiagonal() * map_of(b);
  factor->lower.matrixL().solveInPlace(half);
  Eigen::MatrixXd form = Eigen::MatrixXd::Zero(half.cols(), half.cols());
  form.selfadjointView<Eigen::Lower>().rankUpdate(half.transpose());
  return matrix_of(form.selfadjointView<Eigen::Lower>());
}

Matrix transposed_product(const Matrix& a, const Matrix& b) {
  return matrix_of(map_of(a).transpose() * map_of(b));
}

}  // namespace ressort::linear_algebra
