// core/model: interpolates between networks of the same structure, by a parameter.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "core/model/network.h"
#include "core/result.h"

namespace ressort::model {

// A stop of a morph.
struct MorphStop {
  std::string name;            // name for messages
  const Network* network;      // network with the same structure as all others
  std::vector<double> values;  // [parameter] values
  double gain = 1.0;           // gain of its outputs
};

// Returns a network with the structure, names, lines and drawings of `base`. It equals the first
// stop at `parameter` = 1, the second at 2, and so on. In between, numbers are interpolated
// geometrically (masses, stiffness, damping, times; levels linearly in dB); coordinates, and
// numbers that are not above 0 at both stops, are interpolated linearly. Parameters in `knobs`, and
// those that audio inputs set, are kept; the others become numbers. The error describes the
// difference between two structures, with the line of `base`. O(elements * stops) [any thread but
// audio]
Result<Network> morphed(const Network& base, std::span<const MorphStop> stops,
                        const std::string& parameter, std::span<const std::string> knobs);

}  // namespace ressort::model
