// core/kernels: the halos of shards: copies of the neighbours' nodes.
#pragma once

#include <cstdint>
#include <span>

#include "core/kernels/domains/sharded.h"

namespace ressort::kernels {

inline constexpr std::uint32_t nobody = 0xffffffffu;

// Sets `copies`, `sources` and `given` of shards whose nodes are known. `owner_of`: [node of the
// whole] its shard, or nobody. O(n log n).
void join_halos(std::span<Shard> shards, std::span<const std::uint32_t> owner_of);

}  // namespace ressort::kernels
