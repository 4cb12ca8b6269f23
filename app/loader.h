// app: from a name to what can be compiled: finds the files, reads the texts.
#pragma once

#include <string>
#include <vector>

#include "core/model/mdl.h"
#include "core/model/network.h"
#include "core/model/preset.h"
#include "core/result.h"

namespace ressort {

struct Scene {
  std::string name;  // "PolyTriangle", for people
  std::string path;  // of the file that was asked for
  std::string model_path;
  Network network;
  Preset preset;
  bool has_preset = false;            // read from a file, not made up
  std::vector<std::string> warnings;  // "file:line:column: warning: ..."
};

// Finds and reads a model or a preset with its model. Without a preset the model gets a default
// one, `bare` or playable. The error's message is all diagnostics, one a line, each with its file,
// line and column. Blocks on the disk. [any thread but audio]
Result<Scene> load_scene(const std::string& name, bool bare);

}  // namespace ressort
