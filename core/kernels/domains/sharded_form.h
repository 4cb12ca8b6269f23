// core/kernels: what shards cost that wait for each other.
#pragma once

#include "core/kernels/estimates.h"
#include "core/kernels/program.h"

namespace ressort::kernels {

// Nanoseconds that shards wait for each other once, and one of them for its copies.
double exchange_ns(std::size_t copies);

// The first sample of a shard that others have driven out of the cache takes so many times longer
// than any other.
inline constexpr double return_share = 1.5;
inline constexpr double copy_ns = 7.0;  // of a node's

// What the registry's row of it asks, of one voice in bytes.
double predicted_ns(const Program& program, const Shards& form, const Workload& load);
std::string description(const Program& program, const Shards& form);
std::uint64_t voice_bytes(const Program& program, const Shards& form, std::uint64_t number_bytes);

}  // namespace ressort::kernels
