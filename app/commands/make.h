// app/commands: generates regular models. Returns the exit code.
#pragma once

#include <string>

#include "app/rooms.h"
#include "core/model/generate.h"

namespace ressort::commands {

struct MakeOptions {
  Shape shape;
  std::string output;  // empty: stdout
  bool force = false;  // overwrites an existing file
};

int make(const MakeOptions& options);

}  // namespace ressort::commands
