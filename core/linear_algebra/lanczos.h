// core/linear_algebra: the lowest eigenpairs of A x = lambda B x, many at once, of any multiplicity
// up to the block size. [any thread but audio]
#pragma once

#include <functional>
#include <optional>

#include "core/linear_algebra/eigen.h"
#include "core/linear_algebra/matrix.h"
#include "core/progress.h"

namespace ressort::linear_algebra {

// Overwrites the columns of X with the product of a matrix and X.
using Multiply = std::function<void(Matrix& columns)>;

// Block size: the largest multiplicity that is found at once.
inline constexpr int lanczos_block = 8;

// Returns the `count` pairs with the lowest eigenvalues, normalised to x'Bx = 1, by block Lanczos
// on (A - shift B)^-1 B with full reorthogonalisation (Grimes, Lewis and Simon 1994). `inverse`
// applies (A - shift B)^-1; `shift` lies below all eigenvalues. Empty without convergence.
std::optional<Eigenpairs> lowest_pairs(double shift, int count, int size, const Multiply& inverse,
                                       const Multiply& b, const Progress& progress);

}  // namespace ressort::linear_algebra
