#include "core/analysis/linear.h"

#include <Spectra/MatOp/SparseSymShiftSolve.h>
#include <Spectra/SymEigsShiftSolver.h>
#include <Eigen/Dense>
#include <Eigen/Sparse>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace ressort {
namespace {

using Sparse = Eigen::SparseMatrix<double>;
using Vector = Eigen::VectorXd;

constexpr int dense_size = 64;   // below this a dense solver is faster and never fails
constexpr double rigid = 1e-12;  // a smaller share of the largest stiffness is rounding

// M^(-1/2) A M^(-1/2) for A = K and A = Z, over the masses that move.
struct Scaled {
  Sparse stiffness;
  Sparse damping;
};

Scaled scaled_matrices(const Network& network, std::span<const double> parameters) {
  std::vector<int> index(network.masses.size(), -1);
  std::vector<double> scale;
  for (std::size_t i = 0; i < network.masses.size(); ++i) {
    const Mass& mass = network.masses[i];
    if (moves(mass)) {
      index[i] = static_cast<int>(scale.size());
      scale.push_back(1.0 / std::sqrt(argument_value(network, mass.mass, parameters)));
    }
  }
  std::vector<Eigen::Triplet<double>> stiffness;
  std::vector<Eigen::Triplet<double>> damping;
  const auto add = [&](int i, int j, double k, double z) {
    const double s = scale[static_cast<std::size_t>(i)] * scale[static_cast<std::size_t>(j)];
    stiffness.emplace_back(i, j, k * s);
    damping.emplace_back(i, j, z * s);
  };
  for (std::size_t i = 0; i < network.masses.size(); ++i) {
    const Mass& mass = network.masses[i];
    if (mass.kind == MassKind::oscillator) {
      add(index[i], index[i], argument_value(network, mass.stiffness, parameters),
          argument_value(network, mass.damping, parameters));
    }
  }
  for (const Link& link : network.links) {
    if (link.a == link.b) {
      continue;
    }
    const LinearPart part = linear_part(link);
    const double k = argument_value(network, part.stiffness, parameters);
    const double z = argument_value(network, part.damping, parameters);
    const int a = index[link.a];
    const int b = index[link.b];
    if (a >= 0) {
      add(a, a, k, z);
    }
    if (b >= 0) {
      add(b, b, k, z);
    }
    if (a >= 0 && b >= 0) {
      add(a, b, -k, -z);
      add(b, a, -k, -z);
    }
  }
  const auto size = static_cast<Eigen::Index>(scale.size());
  Scaled matrices{Sparse(size, size), Sparse(size, size)};
  matrices.stiffness.setFromTriplets(stiffness.begin(), stiffness.end());
  matrices.damping.setFromTriplets(damping.begin(), damping.end());
  return matrices;
}

// The eigenpairs nearest to `shift`, which lies a little below 0 so that free networks can be
// factored too. Not every matrix can: one of negative stiffness may be singular there.
bool near_zero(const Sparse& matrix, double shift, Eigen::VectorXd& values,
               Eigen::MatrixXd& vectors) {
  try {  // Spectra tells by exceptions what it cannot factor or iterate
    Spectra::SparseSymShiftSolve<double> shifted(matrix);
    Spectra::SymEigsShiftSolver<Spectra::SparseSymShiftSolve<double>> solver(shifted, 6, 24, shift);
    solver.init();
    solver.compute(Spectra::SortRule::LargestMagn, 200, 1e-10, Spectra::SortRule::SmallestAlge);
    if (solver.info() != Spectra::CompInfo::Successful) {
      return false;
    }
    values = solver.eigenvalues();
    vectors = solver.eigenvectors();
    return true;
  } catch (const std::logic_error&) {
    return false;
  } catch (const std::runtime_error&) {
    return false;
  }
}

// The lowest eigenpair above `floor`.
bool lowest_pair(const Sparse& matrix, double floor, double& value, Vector& vector) {
  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;
  if (matrix.rows() <= dense_size) {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver{Eigen::MatrixXd(matrix)};
    values = solver.eigenvalues();
    vectors = solver.eigenvectors();
  } else if (!near_zero(matrix, -1e3 * floor, values, vectors)) {
    return false;
  }
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    if (values[i] > floor) {
      value = values[i];
      vector = vectors.col(i);
      return true;
    }
  }
  return false;
}

}  // namespace

std::optional<Mode> lowest_mode(const Network& network, std::span<const double> parameters) {
  const Scaled matrices = scaled_matrices(network, parameters);
  if (matrices.stiffness.rows() == 0) {
    return std::nullopt;
  }
  double largest = 0.0;
  for (int k = 0; k < matrices.stiffness.outerSize(); ++k) {
    for (Sparse::InnerIterator entry(matrices.stiffness, k); entry; ++entry) {
      largest = std::max(largest, std::fabs(entry.value()));
    }
  }
  Mode mode;
  Vector shape;
  if (!std::isfinite(largest) || largest == 0.0 ||
      !lowest_pair(matrices.stiffness, rigid * largest, mode.stiffness, shape)) {
    return std::nullopt;
  }
  mode.damping = shape.dot(matrices.damping * shape);
  const double z = std::clamp(mode.damping, 0.0, 0.999);
  const double cosine = (2.0 - mode.stiffness - z) / (2.0 * std::sqrt(1.0 - z));
  mode.frequency_hz = Network::reference_rate_hz / (2.0 * std::numbers::pi) *
                      std::acos(std::clamp(cosine, -1.0, 1.0));
  return mode;
}

}  // namespace ressort
