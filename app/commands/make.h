// app/commands: writes the models that have a regular shape. The exit code comes back.
#pragma once

#include <string>

#include "app/rooms.h"
#include "core/model/generate.h"

namespace ressort::commands {

struct MakeOptions {
  Shape shape;
  std::string output;  // a file; empty for stdout
  bool force = false;  // write over a file that is there
};

int make(const MakeOptions& options);

}  // namespace ressort::commands
