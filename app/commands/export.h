// app/commands: exports a model to FAUST.
#pragma once

#include <optional>
#include <string>

#include "app/rooms.h"
#include "core/model/network.h"

namespace ressort::commands {

struct ExportOptions {
  std::string name;    // model or preset
  std::string output;  // empty: stdout
  bool force = false;  // overwrites an existing file
  bool rescale = true;
  std::optional<ThirdArgument> third;  // empty: as the preset or the model says
};

// Writes the model as FAUST code. Returns the exit code. [main]
int export_to_faust(const ExportOptions& options);

}  // namespace ressort::commands
