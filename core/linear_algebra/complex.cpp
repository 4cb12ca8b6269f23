#include "core/linear_algebra/complex.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>

namespace ressort::linear_algebra {
namespace {

using Map = Eigen::Map<const Eigen::MatrixXcd>;

Map map_of(const ComplexMatrix& matrix) {
  return {matrix.values.data(), static_cast<Eigen::Index>(matrix.rows),
          static_cast<Eigen::Index>(matrix.columns)};
}
Eigen::Map<const Eigen::MatrixXd> map_of(const Matrix& matrix) {
  return {std::begin(matrix.values), static_cast<Eigen::Index>(matrix.rows()),
          static_cast<Eigen::Index>(matrix.columns())};
}

}  // namespace

HermitianEigenpairs hermitian_eigenpairs(const ComplexMatrix& matrix) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXcd> solver(map_of(matrix));
  HermitianEigenpairs pairs{Vector(solver.eigenvalues().data(), matrix.rows),
                            ComplexMatrix(matrix.rows, matrix.rows)};
  std::copy_n(solver.eigenvectors().data(), pairs.vectors.values.size(),
              pairs.vectors.values.data());
  return pairs;
}

std::vector<std::complex<double>> shift_eigenvalues(const ComplexMatrix& basis) {
  const Map all = map_of(basis);
  const auto up = all.topRows(all.rows() - 1);
  const auto down = all.bottomRows(all.rows() - 1);
  const Eigen::MatrixXcd gram = up.adjoint() * up;
  const Eigen::MatrixXcd shift = gram.ldlt().solve(up.adjoint() * down);
  const Eigen::ComplexEigenSolver<Eigen::MatrixXcd> solver(shift, false);
  if (solver.info() != Eigen::Success) {
    return {};
  }
  return {solver.eigenvalues().begin(), solver.eigenvalues().end()};
}

std::optional<Matrix> positive_solution(const Matrix& a, const Matrix& b) {
  const auto given = map_of(a);
  if (given.rows() == 0) {
    return b;
  }
  if (!(given.diagonal().minCoeff() > 0.0)) {
    return std::nullopt;
  }
  const Eigen::VectorXd scale = given.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::LLT<Eigen::MatrixXd> factor(scale.asDiagonal() * given * scale.asDiagonal());
  if (factor.info() != Eigen::Success) {
    return std::nullopt;
  }
  const Eigen::MatrixXd x = scale.asDiagonal() * factor.solve(scale.asDiagonal() * map_of(b));
  Matrix solved(b.rows(), b.columns());
  std::copy_n(x.data(), x.size(), std::begin(solved.values));
  return solved;
}

std::complex<double> schur_complement_of_first(ComplexMatrix matrix) {
  for (std::size_t last = matrix.rows; last-- > 1;) {
    std::size_t pivot = last;
    for (std::size_t i = 1; i < last; ++i) {
      pivot = std::abs(matrix(i, last)) > std::abs(matrix(pivot, last)) ? i : pivot;
    }
    for (std::size_t j = 0; j <= last; ++j) {
      std::swap(matrix(pivot, j), matrix(last, j));
    }
    for (std::size_t i = 0; i < last; ++i) {
      const std::complex<double> share = matrix(i, last) / matrix(last, last);
      for (std::size_t j = 0; j < last; ++j) {
        matrix(i, j) -= share * matrix(last, j);
      }
    }
  }
  return matrix(0, 0);
}

Matrix transposed_product(const Matrix& a, const Matrix& b) {
  const Eigen::MatrixXd both = map_of(a).transpose() * map_of(b);
  Matrix made(a.columns(), b.columns());
  std::copy_n(both.data(), both.size(), std::begin(made.values));
  return made;
}

}  // namespace ressort::linear_algebra
