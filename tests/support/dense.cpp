#include "tests/support/dense.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <complex>
#include <vector>

#include "core/linear_algebra/eigen.h"

namespace ressort::support {
namespace {

using linear_algebra::Matrix;

Matrix matrix_of(const Eigen::MatrixXd& given) {
  Matrix matrix(static_cast<std::size_t>(given.rows()), static_cast<std::size_t>(given.cols()));
  std::copy_n(given.data(), given.size(), std::begin(matrix.values));
  return matrix;
}

Eigen::MatrixXd dense(const Matrix& given) {
  return Eigen::Map<const Eigen::MatrixXd>(std::begin(given.values),
                                           static_cast<Eigen::Index>(given.rows()),
                                           static_cast<Eigen::Index>(given.columns()));
}

}  // namespace

Eigen::MatrixXd inverse_of(const Eigen::MatrixXd& matrix) {
  Matrix one(static_cast<std::size_t>(matrix.rows()), static_cast<std::size_t>(matrix.rows()));
  for (std::size_t i = 0; i < one.rows(); ++i) {
    one(i, i) = 1.0;
  }
  return dense(linear_algebra::quotient(one, matrix_of(matrix)).value());
}

Eigen::VectorXcd eigenvalues_of(const Eigen::MatrixXd& matrix) {
  const std::vector<std::complex<double>> values = linear_algebra::eigenvalues(matrix_of(matrix));
  return Eigen::Map<const Eigen::VectorXcd>(values.data(),
                                            static_cast<Eigen::Index>(values.size()));
}

Eigenbasis eigenbasis_of(const Eigen::MatrixXd& matrix) {
  const linear_algebra::Eigenpairs pairs = linear_algebra::symmetric_eigenpairs(matrix_of(matrix));
  return {Eigen::Map<const Eigen::VectorXd>(std::begin(pairs.values),
                                            static_cast<Eigen::Index>(pairs.values.size())),
          dense(pairs.vectors)};
}

Eigen::VectorXd pencil_values(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  // The eigenvalues of B^(-1/2) A B^(-1/2).
  linear_algebra::Eigenpairs basis = linear_algebra::symmetric_eigenpairs(matrix_of(b));
  for (std::size_t j = 0; j < basis.vectors.columns(); ++j) {
    for (std::size_t i = 0; i < basis.vectors.rows(); ++i) {
      basis.vectors(i, j) /= std::sqrt(basis.values[j]);
    }
  }
  return eigenbasis_of(dense(linear_algebra::in_basis(matrix_of(a), basis.vectors))).values;
}

Eigen::MatrixXd least_squares(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  // Eigen's templates are compiled for complex numbers only.
  return least_squares(Eigen::MatrixXcd(a), Eigen::MatrixXcd(b)).real();
}

Eigen::MatrixXcd least_squares(const Eigen::MatrixXcd& a, const Eigen::MatrixXcd& b) {
  return a.colPivHouseholderQr().solve(b);
}

}  // namespace ressort::support
