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

HermitianEigenpairs hermitian_eigenpairs(const ComplexMatrix& matrix, std::size_t most) {
  // The vectors of the tridiagonal matrix are real, which halves the work.
  const Eigen::Tridiagonalization<Eigen::MatrixXcd> reduced(map_of(matrix));
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver;
  solver.computeFromTridiagonal(reduced.diagonal(), reduced.subDiagonal());
  Eigen::MatrixXcd vectors = solver.eigenvectors().rightCols(static_cast<Eigen::Index>(most));
  vectors.applyOnTheLeft(reduced.matrixQ());
  HermitianEigenpairs pairs{Vector(solver.eigenvalues().data(), matrix.rows),
                            ComplexMatrix(matrix.rows, most)};
  std::copy_n(vectors.data(), vectors.size(), pairs.vectors.values.data());
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
  return matrix_of(map_of(a).transpose() * map_of(b));
}

}  // namespace ressort::linear_algebra
