// core/kernels: whether a Program is a small body for many voices, and its tables.
#pragma once

#include <optional>

#include "core/kernels/estimates.h"
#include "core/kernels/program.h"

namespace ressort::kernels {

inline constexpr std::uint32_t most_batch_masses = 16;  // more do not fit beside the voices

// Nothing where nothing moves, or where it has more than most_batch_masses masses, or points or
// force outputs. O(links). [any thread but audio]
std::optional<Batch> batch_form(const Program& program);

// What the registry's row of it asks, of one voice in bytes.
Work work(const Program& program, const Batch& form, const Workload& load);
std::string description(const Program& program, const Batch& form);
std::uint64_t voice_bytes(const Program& program, const Batch& form, std::uint64_t number_bytes);

}  // namespace ressort::kernels
