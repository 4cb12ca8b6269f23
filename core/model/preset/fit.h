// core/model: whether a preset fits a network.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/model/network.h"
#include "core/model/preset/preset.h"
#include "core/result.h"

namespace ressort {

// The input "inN" as an index into Network::inputs, and the parameter as one into
// Network::parameters; -1 where there is none.
int find_input(const Network& network, std::string_view target);
int find_parameter(const Network& network, std::string_view name);
// What to say of a parameter that there is not.
std::string no_parameter(const Network& network, const std::string& name);

// All that the preset names and the network does not have or cannot do, in the order of the
// preset's lines. [any thread but audio]
std::vector<Error> misfits(const Network& network, const Preset& preset);

// The network with what the preset says is fixed marked so. O(elements) [any thread but audio]
Network with_fixed(Network network, const Preset& preset);

}  // namespace ressort
