// bench: writes a network with FAUST's own mass-interaction library, mi.lib.
#pragma once

#include <optional>
#include <string>

#include "core/model/network.h"
#include "tests/support/rooms.h"

namespace ressort::bench {

// Returns a FAUST program in the form of mi.lib's loop: masses, links, masses again. `process`
// takes in1, in2, ... and returns out1, out2, ...; parameters are sliders of the same names.
// Returns nothing for networks with macros, bodies, waveguides, force outputs, laws that mi.lib
// lacks, or masses whose numbers are driven by audio.
std::optional<std::string> mi_lib_text(const Network& network);

}  // namespace ressort::bench
