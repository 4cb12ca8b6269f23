// bench: a network in the words of FAUST's own mass-interaction library, mi.lib.
#pragma once

#include <optional>
#include <string>

#include "core/model/network.h"
#include "tests/support/rooms.h"

namespace ressort::bench {

// Masses, then links, then masses again, as mi.lib's loop has it; process takes in1, in2, ... and
// returns out1, out2, ...; parameters are sliders of their names. Nothing for macros, bodies and
// waveguides, outputs of forces, laws that mi.lib lacks and numbers of masses that audio drives.
std::optional<std::string> mi_lib_text(const Network& network);

}  // namespace ressort::bench
