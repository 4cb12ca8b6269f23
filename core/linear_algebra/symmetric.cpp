#include <Spectra/SymEigsShiftSolver.h>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <stdexcept>

#include "core/linear_algebra/eigen.h"

namespace ressort::linear_algebra {
namespace {

Eigenpairs pairs_of(const Eigen::VectorXd& values, const Eigen::MatrixXd& vectors) {
  Eigenpairs pairs{
      Vector(values.data(), static_cast<std::size_t>(values.size())),
      Matrix(static_cast<std::size_t>(vectors.rows()), static_cast<std::size_t>(vectors.cols()))};
  std::copy_n(vectors.data(), vectors.size(), std::begin(pairs.vectors.values));
  return pairs;
}

// The operator interface that Spectra expects.
struct Operator {
  using Scalar = double;
  Eigen::Index rows() const { return size; }
  Eigen::Index cols() const { return size; }
  void set_shift(double) const {}  // The inverse already contains the shift.
  void perform_op(const double* from, double* to) const { inverse(from, to); }

  Eigen::Index size;
  const ShiftedInverse& inverse;
};

}  // namespace

Eigenpairs symmetric_eigenpairs(const Matrix& matrix) {
  const auto size = static_cast<Eigen::Index>(matrix.rows());
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(
      Eigen::Map<const Eigen::MatrixXd>(std::begin(matrix.values), size, size));
  return pairs_of(solver.eigenvalues(), solver.eigenvectors());
}

std::optional<Eigenpairs> eigenpairs_near(double shift, int count, int size,
                                          const ShiftedInverse& inverse) {
  constexpr Eigen::Index most_numbers = 30'000'000;  // Limit on the numbers in the Krylov basis.
  const int vectors = std::min(size, std::max(12, count < 20 ? 4 * count : 2 * count + 80));
  const Eigen::Index rounds =
      std::clamp<Eigen::Index>(most_numbers / (vectors * Eigen::Index{size}), 10, 200);
  try {  // Spectra reports a failed iteration by an exception.
    Operator shifted{size, inverse};
    Spectra::SymEigsShiftSolver<Operator> solver(shifted, count, vectors, shift);
    solver.init();
    solver.compute(Spectra::SortRule::LargestMagn, rounds, 1e-10, Spectra::SortRule::SmallestAlge);
    if (solver.info() != Spectra::CompInfo::Successful) {
      return std::nullopt;
    }
    return pairs_of(solver.eigenvalues(), solver.eigenvectors());
  } catch (const std::logic_error&) {
    return std::nullopt;
  } catch (const std::runtime_error&) {
    return std::nullopt;
  }
}

}  // namespace ressort::linear_algebra
