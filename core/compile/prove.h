// core/compile: the stage that proves that the network can be played safely.
#pragma once

#include <optional>
#include <vector>

#include "core/compile/analyse.h"
#include "core/compile/reduce.h"
#include "core/compile/schemes.h"
#include "core/compile/stability_check.h"
#include "core/engine/engine.h"

namespace ressort::compile {

struct Proof {
  StabilityCheck stability;  // proof at the start values and over the parameters' ranges
  Margins margins;           // factors on every stiffness that keys may use
  std::vector<std::optional<RestBound>> rest_bounds;  // [part]; empty: no part is ever frozen
};

// Errors name elements of the written network, or of the reduced one if springs were merged.
// [any thread but audio]
Proof prove(const CompileRequest& request, const Reduced& reduced, const Analysis& analysis,
            const Schemes& schemes, const Machine& machine);

// Returns a bound on the outputs of each resting part, by the compliance of the network at its
// outputs and at contacts and plucks. A part has no bound if one of its outputs is a force or if it
// can drift. No part has one if more than 64 places would have to be solved. The network must be
// stable in the box. [any thread but audio]
std::vector<std::optional<RestBound>> make_rest_bounds(const Network& network,
                                                       const Machine& machine,
                                                       const ParameterBox& box,
                                                       const Progress& progress = {});

}  // namespace ressort::compile
