// app/commands: all that a session manager wants to find again, in a folder: the preset as it is
// now and the texts that it is read from, the tuning, the cables.
#pragma once

#include <string>
#include <vector>

#include "app/devices/wiring.h"
#include "app/session/session.h"

namespace ressort::commands {

struct KeptStage {
  std::string scene;                // a path; empty: nothing was kept
  std::vector<std::string> tuning;  // paths, as the command `tuning` takes them
  std::vector<Cable> cables;
};

// Writes it all; what was kept there before is replaced when the new is whole. Blocks on the disk.
Result<Done> keep_stage(const std::string& folder, Session& session,
                        const std::vector<Cable>& cables);

// What it would write now but for the cables, told apart by its text; empty: nothing is loaded.
std::string stage_state(const Session& session);

// Nothing kept where there is no such folder; an error where there is one that cannot be read.
Result<KeptStage> find_stage(const std::string& folder);

}  // namespace ressort::commands
