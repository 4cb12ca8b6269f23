// core/linear_algebra: the lowest eigenpairs of A x = lambda B x, many at once and of any
// multiplicity up to the width of a block. [any thread but audio]
#pragma once

#include <functional>
#include <optional>

#include "core/linear_algebra/eigen.h"
#include "core/linear_algebra/matrix.h"
#include "core/progress.h"

namespace ressort::linear_algebra {

// Overwrites the columns of X with those of a matrix times X.
using Multiply = std::function<void(Matrix& columns)>;

// Equal eigenvalues of which a block of vectors finds all at once.
inline constexpr int lanczos_block = 8;

// The `count` pairs with the lowest eigenvalues, x'Bx = 1: block Lanczos on (A - shift B)^-1 B with
// every vector kept orthogonal to all others (Grimes, Lewis and Simon 1994). `inverse` multiplies
// with (A - shift B)^-1, and `shift` lies below all of them. Nothing where they do not converge.
std::optional<Eigenpairs> lowest_pairs(double shift, int count, int size, const Multiply& inverse,
                                       const Multiply& b, const Progress& progress);

}  // namespace ressort::linear_algebra
