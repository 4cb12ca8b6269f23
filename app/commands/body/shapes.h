// app/commands: a picture of how a solid moves in its modes. Pure.
#pragma once

#include <string>
#include <vector>

#include "app/rooms.h"
#include "core/solids/solid_modes.h"

namespace ressort::commands {

// An SVG: the lowest modes side by side, each bent as far as can be seen and coloured by how far it
// moves, what lies in front over what lies behind; and where the places are.
std::string shapes_picture(const SolidMesh& mesh, const SolidModes& modes,
                           const std::vector<SolidPlace>& places, const std::string& title);

}  // namespace ressort::commands
