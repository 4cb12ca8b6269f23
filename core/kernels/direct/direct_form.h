// core/kernels: what the direct form and the one with compensated positions cost, of any Program.
#pragma once

#include "core/kernels/estimates.h"
#include "core/kernels/program.h"

namespace ressort::kernels {

// What the registry's row of it asks, of one voice in bytes.
Work work(const Program& program, const Direct& form, const Workload& load);
std::string description(const Program& program, const Direct& form);
std::uint64_t voice_bytes(const Program& program, const Direct& form, std::uint64_t number_bytes);

// What the registry's row of it asks, of one voice in bytes.
double predicted_ns(const Program& program, const Compensated& form, const Workload& load);
std::string description(const Program& program, const Compensated& form);
std::uint64_t voice_bytes(const Program& program, const Compensated& form,
                          std::uint64_t number_bytes);

}  // namespace ressort::kernels
