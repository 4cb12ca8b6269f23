// core/kernels: whether a Program is a regular network, and its tables if it is.
#pragma once

#include <optional>

#include "core/kernels/estimates.h"
#include "core/kernels/program.h"
#include "core/progress.h"

namespace ressort::kernels {

inline constexpr std::uint32_t least_grid_masses = 16;

// Of a Program whose masses are mostly alike and lie in rows that are alike, in whatever order they
// were written; what does not fit must be little, and no output a force. O(n log n). [any thread
// but audio]
std::optional<Grid> grid_form(const Program& program, const Progress& progress = {});

// What the registry's row of it asks, of one voice in bytes.
Work work(const Program& program, const Grid& form, const Workload& load);
std::string description(const Program& program, const Grid& form);
std::uint64_t voice_bytes(const Program& program, const Grid& form, std::uint64_t number_bytes);

}  // namespace ressort::kernels
