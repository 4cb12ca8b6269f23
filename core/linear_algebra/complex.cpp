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

}  // namespace ressort::linear_algebra
