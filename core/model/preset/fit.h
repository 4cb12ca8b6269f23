// core/model: checks that a preset fits a network.
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

// Return the index of input "inN" in Network::inputs, and of the parameter in Network::parameters;
// -1 if there is none.
int find_input(const Network& network, std::string_view target);
int find_parameter(const Network& network, std::string_view name);
// Returns the error message for an unknown parameter.
std::string no_parameter(const Network& network, const std::string& name);

// The position at which an input begins to touch a resting mass through a contact or a pluck, and
// the direction of the touch: 1 upwards, -1 downwards.
struct Touch {
  std::uint32_t mass = 0;  // the mass that is touched
  double position = 0.0;
  double inwards = 1.0;
};
std::optional<Touch> touch_of(const Network& network, std::size_t input);

// Returns the network with one output at each mass that a control in swings touches, no others, and
// these inputs far away from the masses.
Network heard_where_touched(Network network, const Preset& preset);

// Returns an error for everything in the preset that the network does not have or support, in the
// order of the preset's lines. [any thread but audio]
std::vector<Error> find_preset_errors(const Network& network, const Preset& preset);

// Returns the network with the parameters of the preset's bodies and of `hardness` that it does not
// have itself, at their values, so that they are parameters of the preset. A parameter of the same
// name is shared. Parameters that an audio input of a body sets are not added. [any thread but
// audio]
Network with_preset_parameters(Network network, const Preset& preset);

// Sets is_fixed for the elements in the preset's `fixed`. O(elements) [any thread but audio]
Network with_fixed(Network network, const Preset& preset);

}  // namespace ressort::model
