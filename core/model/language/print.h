// core/model: a Network as text again.
#pragma once

#include <string>

#include "core/model/network.h"

namespace ressort::model {

// The text of a network, in one dialect (MIMS4Max's, and 'massG' for a gravity that is not per
// rate): `parse_network(print_network(n)).network == n` for every network that was read. A line
// '~motion' is there only where the rest of the text would be taken for the other meaning.
//
// Masses and links without names, as expand_macros makes them, get some that are free. A place
// between the nodes of an expanded macro has no text: its nearest node stands for it, below a
// comment that says so. [any thread but audio]
std::string print_network(const Network& network);

}  // namespace ressort::model
