// core/compile: the tables of a Program that has no order which another kernel could use.
#pragma once

#include <optional>

#include "core/kernels/program.h"
#include "core/progress.h"

namespace ressort {

inline constexpr std::uint32_t least_sparse_masses = 10;

// Nothing where fewer masses move, where there are points on macros, or where a force is heard at
// what stands and two such are linked. O(n log n). [any thread but audio]
std::optional<Sparse> sparse_form(const Program& program, const Progress& progress = {});

}  // namespace ressort
