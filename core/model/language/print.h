// core/model: prints a Network in the .mdl language.
#pragma once

#include <string>

#include "core/model/network.h"

namespace ressort::model {

// Prints a network in one dialect: that of MIMS4Max, with 'massG' for a gravity that is not per
// rate. `parse_network(print_network(n)).network == n` holds for every network that was read. The
// line
// '~motion' is printed only if the reader would otherwise choose the other meaning.
//
// Masses and links without names (see expand_macros) get unused ones. A place between the nodes of
// an expanded macro cannot be written: the nearest node replaces it, after a comment. [any thread
// but audio]
std::string print_network(const Network& network);

}  // namespace ressort::model
