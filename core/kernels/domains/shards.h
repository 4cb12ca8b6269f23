// core/kernels: divides a large Program among several cores.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/kernels/domains/sharded.h"
#include "core/kernels/estimates.h"
#include "core/progress.h"

namespace ressort::kernels {

// Makes `count` shards with halos slightly deeper than `frames` links, in the direct form. Empty if
// a point moves over a macro, because it may be anywhere. O(nodes + links).
std::vector<Shard> make_shards(const Program& program, std::size_t count, std::uint32_t frames);

// Divides the Program, in its own form, for load.executor if that is predicted to pay: for direct,
// chains or grid, and samples of several microseconds. If a thread's part exceeds a cache (the
// first level for chains, the second for others), it gets several shards that each fit, and steps
// each for several samples before the next. O(nodes + links), plus making the forms. [any thread
// but audio]
std::optional<Shards> share_out(const Program& program, const Workload& load,
                                const Progress& progress = {});

// Returns the caller's own thread if a workload has no executor, or one with a single thread.
Executor* executor_of(const Workload& load);

}  // namespace ressort::kernels
