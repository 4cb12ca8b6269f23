// core/kernels: whether a Program is a small body for the dense kernel, and its tables.
#pragma once

#include <optional>

#include "core/kernels/estimates.h"
#include "core/kernels/program.h"

namespace ressort::kernels {

// Nothing where it has more than most_dense_masses masses, or points, force outputs, audio
// parameters, or outputs of what is no mass. O(links). [any thread but audio]
std::optional<Dense> dense_form(const Program& program);

// What the registry's row of it asks, of one voice in bytes.
Work work(const Program& program, const Dense& form, const Workload& load);
std::string description(const Program& program, const Dense& form);
std::uint64_t voice_bytes(const Program& program, const Dense& form, std::uint64_t number_bytes);

}  // namespace ressort::kernels
