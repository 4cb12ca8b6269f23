// tests: what Eigen does with dense matrices, as plain functions, so that its templates are
// compiled once for all tests. Needs Eigen.
#pragma once

#include <Eigen/Core>

namespace ressort::support {

Eigen::MatrixXd inverse_of(const Eigen::MatrixXd& matrix);

Eigen::VectorXcd eigenvalues_of(const Eigen::MatrixXd& matrix);

struct Eigenbasis {
  Eigen::VectorXd values;   // ascending
  Eigen::MatrixXd vectors;  // [row, pair]
};

// Of a symmetric matrix.
Eigenbasis eigenbasis_of(const Eigen::MatrixXd& matrix);

// The w of A x = w B x, ascending; both symmetric, B positive.
Eigen::VectorXd pencil_values(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);

// The x for which |A x - B| is the least, column by column.
Eigen::MatrixXd least_squares(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);
Eigen::MatrixXcd least_squares(const Eigen::MatrixXcd& a, const Eigen::MatrixXcd& b);

}  // namespace ressort::support
