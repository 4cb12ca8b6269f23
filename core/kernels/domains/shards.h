// core/kernels: divides a large Program among several cores.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/kernels/domains/sharded.h"
#include "core/kernels/estimates.h"
#include "core/progress.h"

namespace ressort::kernels {

// As many shards, each with what is within a little more than `frames` links of its own, in the
// direct form; nothing where a point wanders over a macro, as it may be anywhere. O(nodes + links).
std::vector<Shard> make_shards(const Program& program, std::size_t count, std::uint32_t frames);

// Shards in the Program's own form for load.executor, if they are predicted to pay: of direct,
// chains or grid, where a sample takes several microseconds. Where what a thread has would not
// fit into a cache, the first of chains and the second of all others, it has several shards: each
// does, and goes on there for several samples before the next one's turn.
// O(nodes + links), and what the form takes. [any thread but audio]
std::optional<Shards> share_out(const Program& program, const Workload& load,
                                const Progress& progress = {});

// The own thread where a workload has no executor, or one of a single thread.
Executor* executor_of(const Workload& load);

}  // namespace ressort::kernels
