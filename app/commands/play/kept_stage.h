// app/commands: the state that a session manager stores in a folder: the current preset with its
// source files, the tuning and the JACK connections.
#pragma once

#include <string>
#include <vector>

#include "app/devices/wiring.h"
#include "app/session/session.h"

namespace ressort::commands {

struct SavedState {
  std::string scene;                // path; empty: nothing was saved
  std::vector<std::string> tuning;  // paths, as for the command `tuning`
  std::vector<Cable> cables;
};

// Writes the state, and replaces the previous one when the new one is complete. Blocks on the disk.
Result<Done> save_state_to(const std::string& folder, Session& session,
                           const std::vector<Cable>& cables);

// Returns the state without the connections as a text to compare; empty if nothing is loaded.
std::string current_state(const Session& session);

// Reads the state. Empty if the folder does not exist; fails if it cannot be read.
Result<SavedState> read_saved_state(const std::string& folder);

}  // namespace ressort::commands
