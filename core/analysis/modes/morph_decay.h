// core/analysis: evens out the decay time of a morph between its stops.
#pragma once

#include <cstddef>
#include <span>

#include "core/model/network.h"
#include "core/progress.h"

namespace ressort::analysis {

struct MorphedDecay {
  std::size_t parameter = 0;       // The morph's parameter, which runs from 1 to the number
  std::size_t stops = 2;           // of stops.
  std::span<const double> values;  // [parameter]
  Progress progress = {};
};

// Returns the network of a morph, unchanged at each stop, with a factor on all dampers between the
// stops, so that the T60 of the mode that keys tune changes by equal ratios. Without it, a material
// that loses less combined with a stronger air loss would ring too long in the middle. Accurate to
// 1 % for dampers that grow a hundredfold in a leg. Nothing changes if there is no such mode, if it
// is undamped, or if its T60 is even already. O(stops) decompositions. Throws what Progress throws.
// [any thread but audio]
Network with_even_decay(Network network, const MorphedDecay& morph);

}  // namespace ressort::analysis
