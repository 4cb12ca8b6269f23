// core/kernels: decides whether a Program is a small body for many voices, and makes its tables.
#pragma once

#include <optional>

#include "core/kernels/estimates.h"
#include "core/kernels/program.h"

namespace ressort::kernels {

// Larger bodies do not fit into the cache together with their voices.
inline constexpr std::uint32_t most_batch_masses = 16;

// Empty if nothing moves, or if the Program has more than most_batch_masses masses, points or force
// outputs. O(links). [any thread but audio]
std::optional<Batch> batch_form(const Program& program);

// Functions for the registry's row; memory is per voice, in bytes.
Work work(const Program& program, const Batch& form, const Workload& load);
std::string description(const Program& program, const Batch& form);
std::uint64_t voice_bytes(const Program& program, const Batch& form, std::uint64_t number_bytes);

}  // namespace ressort::kernels
