// core/analysis/modes: the lowest motions of a large sparse system, by shift and invert.
#pragma once

#include <cstddef>

#include "core/analysis/modes/quadratic.h"
#include "core/linear_algebra/matrix.h"
#include "core/progress.h"
#include "core/result.h"

namespace ressort::analysis {

// At least `count` of the lowest that swing, if there are so many, in the terms of quadratic.h:
// Lanczos' shapes without dampers, counted by Sylvester's inertia so that none of several alike is
// missed, and what dampers add to them until mu^2 + (1 + e mu) K + mu Z leaves no more than
// `tolerance` |mu|^2 of a shape. Fails where the rows hang together at random, or nothing
// converges. [any thread but audio]
Result<Swings> lowest_swings(const SparseMatrix& stiffness, const SparseMatrix& damping, double e,
                             double rigid, std::size_t count, const Progress& progress);

inline constexpr double swing_tolerance = 1e-8;

// What is left of a shape, in its own |mu|^2.
double residual(const SparseMatrix& stiffness, const SparseMatrix& damping, double e,
                const Swing& swing);

}  // namespace ressort::analysis
