// core/compile: whether a Program is a small body for many voices, and its tables.
#pragma once

#include <optional>

#include "core/kernels/program.h"

namespace ressort {

inline constexpr std::uint32_t most_chorus_masses = 16;  // more do not fit beside the voices

// Nothing where nothing moves, or where it has more than most_chorus_masses masses, or points or
// force outputs. O(links). [any thread but audio]
std::optional<Chorus> chorus_form(const Program& program);

}  // namespace ressort
