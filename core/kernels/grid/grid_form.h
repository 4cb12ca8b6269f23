// core/kernels: decides whether a Program is a regular network, and makes its tables.
#pragma once

#include <optional>

#include "core/kernels/estimates.h"
#include "core/kernels/program.h"
#include "core/progress.h"

namespace ressort::kernels {

inline constexpr std::uint32_t least_grid_masses = 16;

// Makes the tables of a Program whose masses are mostly alike and lie in similar rows, in any order
// of numbering. Few links may be left over, and no output may be a force. O(n log n). [any thread
// but audio]
std::optional<Grid> grid_form(const Program& program, const Progress& progress = {});

// Functions for the registry's row; memory is per voice, in bytes.
Work work(const Program& program, const Grid& form, const Workload& load);
std::string description(const Program& program, const Grid& form);
std::uint64_t voice_bytes(const Program& program, const Grid& form, std::uint64_t number_bytes);

}  // namespace ressort::kernels
