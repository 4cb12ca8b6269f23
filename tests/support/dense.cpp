#include "tests/support/dense.h"

#include <Eigen/Dense>

namespace ressort::support {

Eigen::MatrixXd inverse_of(const Eigen::MatrixXd& matrix) {
  return matrix.inverse();
}

Eigen::VectorXcd eigenvalues_of(const Eigen::MatrixXd& matrix) {
  return matrix.eigenvalues();
}

Eigenbasis eigenbasis_of(const Eigen::MatrixXd& matrix) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(matrix);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

Eigen::VectorXd pencil_values(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  return Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd>(a, b, Eigen::EigenvaluesOnly)
      .eigenvalues();
}

Eigen::MatrixXd least_squares(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  return a.colPivHouseholderQr().solve(b);
}

Eigen::MatrixXcd least_squares(const Eigen::MatrixXcd& a, const Eigen::MatrixXcd& b) {
  return a.colPivHouseholderQr().solve(b);
}

}  // namespace ressort::support
