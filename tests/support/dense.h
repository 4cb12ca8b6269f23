// tests: Eigen's dense matrix functions as plain functions, so that their templates are compiled
// once for all tests. Needs Eigen.
#pragma once

#include <Eigen/Core>

namespace ressort::support {

Eigen::MatrixXd inverse_of(const Eigen::MatrixXd& matrix);

Eigen::VectorXcd eigenvalues_of(const Eigen::MatrixXd& matrix);

struct Eigenbasis {
  Eigen::VectorXd values;   // ascending
  Eigen::MatrixXd vectors;  // [row, pair]
};

// Eigenpairs of a symmetric matrix.
Eigenbasis eigenbasis_of(const Eigen::MatrixXd& matrix);

// Returns the w of A x = w B x, ascending, for symmetric A and symmetric positive definite B.
Eigen::VectorXd pencil_values(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);

// Return the x that minimises |A x - B|, column by column.
Eigen::MatrixXd least_squares(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);
Eigen::MatrixXcd least_squares(const Eigen::MatrixXcd& a, const Eigen::MatrixXcd& b);

}  // namespace ressort::support
