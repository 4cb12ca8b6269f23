// core/kernels: the cost and memory of the direct form, which every Program has.
#pragma once

#include "core/kernels/estimates.h"
#include "core/kernels/program.h"

namespace ressort::kernels {

Work work(const Program& program, const Direct& form, const Workload& load);
std::string description(const Program& program, const Direct& form);
std::uint64_t voice_bytes(const Program& program, const Direct& form, std::uint64_t number_bytes);

}  // namespace ressort::kernels
