// core/model: whether a preset fits a network.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/model/network.h"
#include "core/model/preset/preset.h"
#include "core/result.h"

namespace ressort::model {

// The input "inN" as an index into Network::inputs, and the parameter as one into
// Network::parameters; -1 where there is none.
int find_input(const Network& network, std::string_view target);
int find_parameter(const Network& network, std::string_view name);
// What to say of a parameter that there is not.
std::string no_parameter(const Network& network, const std::string& name);

// Where a hand begins to feel what rests at the other end of its contact or its pluck, and which
// way goes into it: 1 upwards, -1 downwards. Nothing where it has neither.
struct Touch {
  std::uint32_t mass = 0;  // at that end
  double position = 0.0;
  double inwards = 1.0;
};
std::optional<Touch> touch_of(const Network& network, std::size_t input);

// The network with an output at each mass that the preset's swings are of, and no other, and with
// the hands there far away.
Network heard_where_touched(Network network, const Preset& preset);

// All that the preset names and the network does not have or cannot do, in the order of the
// preset's lines. [any thread but audio]
std::vector<Error> find_preset_errors(const Network& network, const Preset& preset);

// The network with what the preset says is fixed marked so. O(elements) [any thread but audio]
Network with_fixed(Network network, const Preset& preset);

}  // namespace ressort::model
