// core/analysis/modes: the lowest oscillating modes of a large sparse system, by shift-and-invert.
#pragma once

#include <cstddef>

#include "core/analysis/modes/quadratic.h"
#include "core/linear_algebra/matrix.h"
#include "core/progress.h"
#include "core/result.h"

namespace ressort::analysis {

// Returns at least `count` of the lowest oscillating modes, if there are that many, in the terms of
// quadratic.h. Lanczos finds the undamped shapes, and Sylvester's law of inertia counts them, so
// that no degenerate one is missed. The basis is then extended until the residual of mu^2 + (1 + e
// mu) K + mu Z is at most `tolerance` |mu|^2 for each shape. Fails if the rows are randomly
// connected, or without convergence. [any thread but audio]
Result<Swings> lowest_swings(const SparseMatrix& stiffness, const SparseMatrix& damping, double e,
                             double rigid, std::size_t count, const Progress& progress);

inline constexpr double swing_tolerance = 1e-8;

// Returns the residual of a mode, relative to its |mu|^2.
double residual(const SparseMatrix& stiffness, const SparseMatrix& damping, double e,
                const Swing& swing);

}  // namespace ressort::analysis
