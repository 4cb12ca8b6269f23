// app/commands: what rings in a recording.
#pragma once

#include <string>

#include "app/rooms.h"
#include "core/identification/identify.h"
#include "core/progress.h"
#include "core/result.h"

namespace ressort::commands {

// Of the first minute of a sound file; that there was more is among its warnings. The error names
// the file. Blocks. [any thread but audio]
Result<Identification> identify_recording(const std::string& path, const IdentifyOptions& options,
                                          const Progress& progress);

}  // namespace ressort::commands
