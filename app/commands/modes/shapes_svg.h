// app/commands: what the modes of a network look like.
#pragma once

#include <string>

#include "app/rooms.h"
#include "core/analysis/modes/modes.h"

namespace ressort::commands {

inline constexpr std::size_t most_drawn_modes = 48;

// A picture of each of the lowest modes: meshes, and masses with a place in the model's drawing,
// from above, red up and blue down, larger where it moves farther; else along their order, as a
// line. `network` is what the modes were found of, as it is written. Pure.
std::string shapes_svg(const NetworkModes& modes, const Network& network, const std::string& title);

}  // namespace ressort::commands
