// core/compile: an upper bound on the stiffness of a Program's modes.
#pragma once

#include <span>

#include "core/kernels/program.h"

namespace ressort::compile {

// Upper bounds on a mode's stiffness, per sample and unit mass, by the edge bound. Every link
// counts by the spring and damper that it contains.
struct Steepness {
  double stiffness = 0.0;  // K/M
  double both = 0.0;       // (K + 6Z)/M, which ranks settings by stiffness and damping
};
// O(links)
Steepness steepness_of(const Program& program, std::span<const double> parameters);

}  // namespace ressort::compile
