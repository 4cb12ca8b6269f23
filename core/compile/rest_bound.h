// core/compile: what bounds a part that nothing stirs.
#pragma once

#include <optional>
#include <vector>

#include "core/analysis/interval.h"
#include "core/engine/engine.h"
#include "core/model/network.h"
#include "core/progress.h"

namespace ressort::compile {

// [part] of the machine made of this network without macros; nothing where forces are heard, where
// something drifts, and where there is too much of it. The network has to be stable in the box.
// [any thread but audio]
std::vector<std::optional<RestBound>> make_rest_bounds(const Network& network,
                                                       const Machine& machine,
                                                       const ParameterBox& box,
                                                       const Progress& progress = {});

}  // namespace ressort::compile
