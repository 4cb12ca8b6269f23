// core/analysis/modes: how a linear system of few rows swings: mu^2 + (1 + e mu) K + mu Z,
// singular.
//
// e is 1 for what the published scheme plays, where a motion grows by 1 + mu in a sample, and 0 for
// the continuous network, where it goes as e^(mu t).
#pragma once

#include <complex>
#include <optional>
#include <vector>

#include "core/linear_algebra/matrix.h"

namespace ressort::analysis {

// A motion that swings: its mu has an imaginary part above 0. `shape` is scaled so that
// shapeT (2 mu + e K + Z) shape is mu less its conjugate, as of a lone mass of 1: of proportional
// damping it is real and of length 1.
struct Swing {
  std::complex<double> mu;
  ComplexVector shape;
};

struct Swings {
  std::vector<Swing> all;
  bool is_proportional = true;
  // [row, shape] The eigenvectors that K and Z share, those of what does not swing too; empty where
  // they share none.
  Matrix basis;
};

// mu of a lone mass of 1 with k and z, if it swings: `rigid` as below.
std::optional<std::complex<double>> swing_root(double k, double z, double e, double rigid);

// By how much a shape may be off its own eigenvalue, of the largest number of a matrix with so many
// rows, where only rounding has made it so.
double shared_tolerance(std::size_t rows);

// What swings of symmetric K and Z, in no order; `rigid`: a k below which nothing is sprung.
// Nothing where the eigenvalues cannot be found, or damping is not proportional and nobody wants to
// wait for what `may_cross`. O(rows^3)
std::optional<Swings> swings_of(const Matrix& stiffness, const Matrix& damping, double e,
                                double rigid, bool may_cross = true);

}  // namespace ressort::analysis
