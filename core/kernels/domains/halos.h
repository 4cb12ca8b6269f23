// core/kernels: what shards copy of each other.
#pragma once

#include <cstdint>
#include <functional>
#include <span>

#include "core/kernels/domains/sharded.h"

namespace ressort::kernels {

inline constexpr std::uint32_t nobody = 0xffffffffu;

// Finds copies, sources and what is given, of shards whose nodes are known; of one without nodes
// nobody shall have a copy. `owner_of` a node of the whole: its shard, or nobody. O(n log n).
void join_halos(std::span<Shard> shards,
                const std::function<std::uint32_t(std::uint32_t)>& owner_of);

}  // namespace ressort::kernels
