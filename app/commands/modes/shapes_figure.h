// app/commands: a figure of the mode shapes of a network. Pure.
#pragma once

#include <string>

#include "app/plot/plot.h"
#include "core/analysis/modes/modes.h"

namespace ressort::commands {

inline constexpr std::size_t most_drawn_modes = 48;

// Draws the lowest modes side by side. Meshes, and masses with a place in the model's drawing, are
// seen from above: red is up, blue is down, and the area of a dot shows the displacement. All other
// networks are drawn as lines, mass by mass. `network` is the network as written.
plot::Figure network_shapes_figure(const NetworkModes& modes, const Network& network,
                                   const std::string& title);

}  // namespace ressort::commands
