// core/compile: how keys reach the pitch of a network with waveguides, and how high it may be.
#pragma once

#include <optional>
#include <span>

#include "core/analysis/interval.h"
#include "core/analysis/linear.h"
#include "core/result.h"

namespace ressort::compile {

// The lowest partial of the lowest waveguide as if it were a mode without damping, whose stiffness
// is the square of its angle: by which factor on every stiffness it has the pitch of a key is exact
// then, with Stepping::Scheme::exact. Of an expanded network; nothing if every waveguide is fixed.
std::optional<LowestShapes> waveguide_shapes(const Network& network,
                                             std::span<const double> parameters);

// What the first waveguide would need that is too high for its places at this rate, or is no
// number above 0, with its line.
std::optional<Error> waveguide_too_high(const Network& network, std::span<const double> parameters,
                                        double rate_hz);

// By how much every stiffness may grow until a waveguide is as high as its places let it be,
// wherever the parameters are; endless without waveguides.
double highest_waveguide_factor(const Network& network, const ParameterBox& box, double rate_hz);

}  // namespace ressort::compile
