// core/model: one network that goes through several of one structure, as a parameter says.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "core/model/network.h"
#include "core/result.h"

namespace ressort::model {

// Where a morph passes.
struct MorphStop {
  std::string name;            // for people
  const Network* network;      // of the structure of all others
  std::vector<double> values;  // [parameter] of its own
  double gain = 1.0;           // of its outputs
};

// A network of the structure of `base`, with its names, lines and drawings, that is the first stop
// where `parameter` is 1, the second where it is 2, and so on. Between two, every number goes by
// equal ratios: masses, stiffness, damping, times, levels (straight lines of dB); places, and what
// is not above 0 at both, go in straight lines. Of their parameters those that `knobs` names, and
// those that audio gives, stay what they are; the others are numbers. The error says how two
// structures differ, with the line of `base`, or what stands in the way. O(elements * stops)
// [any thread but audio]
Result<Network> morphed(const Network& base, std::span<const MorphStop> stops,
                        const std::string& parameter, std::span<const std::string> knobs);

}  // namespace ressort::model
