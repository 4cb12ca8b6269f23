// core/analysis/modes: solves the quadratic eigenproblem of a small linear system: the mu for which
// mu^2 + (1 + e mu) K + mu Z is singular.
//
// e is 1 for the published scheme, where a motion grows by 1 + mu per sample, and 0 for the
// continuous network, where it evolves as e^(mu t).
#pragma once

#include <complex>
#include <optional>
#include <vector>

#include "core/linear_algebra/matrix.h"

namespace ressort::analysis {

// An oscillating mode: the imaginary part of its mu is above 0. `shape` is scaled so that shape^T
// (2 mu + e K + Z) shape is mu minus its conjugate, as for a single unit mass. For proportional
// damping the shape is real and of length 1.
struct Swing {
  std::complex<double> mu;
  ComplexVector shape;
};

struct Swings {
  std::vector<Swing> all;
  bool is_proportional = true;
  // [row, shape] Shared eigenvectors of K and Z, including those of motions that do not oscillate;
  // empty if they share none.
  Matrix basis;
};

// Returns the mu of a single unit mass with k and z, if it oscillates; `rigid` as below.
std::optional<std::complex<double>> swing_root(double k, double z, double e, double rigid);

// Returns the error of a shape's eigenvalue that rounding alone explains, relative to the largest
// element, for so many rows.
double shared_tolerance(std::size_t rows);

// Returns the oscillating modes of symmetric K and Z, unsorted; a k below `rigid` counts as 0.
// Empty if the eigenvalues cannot be found, or if damping is not proportional and `may_cross` is
// false. O(rows^3)
std::optional<Swings> swings_of(const Matrix& stiffness, const Matrix& damping, double e,
                                double rigid, bool may_cross = true);

}  // namespace ressort::analysis
