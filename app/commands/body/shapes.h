// app/commands: a figure of the mode shapes of a solid. Pure.
#pragma once

#include <string>
#include <vector>

#include "app/plot/plot.h"
#include "core/solids/solid_modes.h"

namespace ressort::commands {

// The lowest modes side by side: the surface, bent by the mode and coloured by how far it moves,
// and the named places.
plot::Figure shapes_figure(const SolidMesh& mesh, const SolidModes& modes,
                           const std::vector<SolidPlace>& places, const std::string& title);

}  // namespace ressort::commands
