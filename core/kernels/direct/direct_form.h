// core/kernels: the form that every Program has, and its cost and memory.
#pragma once

#include <cstdint>
#include <string>

namespace ressort::kernels {

struct Program;
struct Workload;

// The network as it is written, one voice in each lane. It needs no tables.
struct Direct {};

double operations(const Program& program, const Direct& form, const Workload& load);
std::string description(const Program& program, const Direct& form);
std::uint64_t voice_bytes(const Program& program, const Direct& form, std::uint64_t number_bytes);

}  // namespace ressort::kernels
