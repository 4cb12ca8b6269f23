// app/commands: a model in another program's language.
#pragma once

#include <optional>
#include <string>

#include "app/rooms.h"
#include "core/model/network.h"

namespace ressort::commands {

struct ExportOptions {
  std::string name;    // model or preset
  std::string output;  // a file; empty: to stdout
  bool force = false;  // write over a file that is there
  bool rescale = true;
  std::optional<ThirdArgument> third;  // whatever preset and model say
};

// Writes the model as a FAUST program; the exit code comes back. [main]
int export_to_faust(const ExportOptions& options);

}  // namespace ressort::commands
