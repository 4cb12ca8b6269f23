// core/compile: the stage that expands macros and merges parallel springs.
#pragma once

#include <cstddef>

#include "core/compile/options.h"
#include "core/model/network.h"
#include "core/progress.h"

namespace ressort::compile {

struct Reduced {
  Network network;                 // without macros
  std::size_t merged_springs = 0;  // number of springs that were merged into another one
};

// Returns the network to play. A bare network without a budget is not merged. O(n).
// [any thread but audio]
Reduced reduce(const CompileRequest& request);

// Adds the stiffness and damping of parallel springs, which changes the output by rounding only.
// Elements keep their numbers: a merged spring stays as a link without strength. For networks
// without macros. O(n). [any thread but audio]
Reduced merge_parallel_springs(Network network, const Progress& progress = {});

}  // namespace ressort::compile
