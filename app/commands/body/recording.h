// app/commands: finds the modes in a recording.
#pragma once

#include <string>

#include "app/rooms.h"
#include "core/identification/identify.h"
#include "core/progress.h"
#include "core/result.h"

namespace ressort::commands {

// Finds modes in the first minute of a sound file; warns if the file is longer. Errors have the
// file name. Blocks. [any thread but audio]
Result<Identification> identify_recording(const std::string& path, const IdentifyOptions& options,
                                          const Progress& progress);

}  // namespace ressort::commands
