// core/analysis: how long a morph rings between its stops.
#pragma once

#include <cstddef>
#include <span>

#include "core/model/network.h"
#include "core/progress.h"

namespace ressort::analysis {

struct MorphedDecay {
  std::size_t parameter = 0;       // of the morph, which goes from 1 to as many as
  std::size_t stops = 2;           // there are
  int pitch_mode = 1;              // which mode keys tune
  std::span<const double> values;  // [parameter]
  Progress progress = {};
};

// The network of a morph, each stop as it was, with a factor on all dampers between them so that
// the T60 of the mode that keys tune goes by equal ratios from one to the next: springs that lose
// less and air that takes more do not leave it too long in the middle. To 1 % where a damper grows
// a hundred times in a leg. Where there is no such mode, nothing damps it, or it does so by itself,
// nothing is changed. O(stops) decompositions. Throws what a Progress does. [any thread but audio]
Network with_even_decay(Network network, const MorphedDecay& morph);

}  // namespace ressort::analysis
