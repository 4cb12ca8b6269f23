// app/commands: the command line of `modes`.
#pragma once

#include <CLI/CLI.hpp>

#include "app/commands/modes/modes.h"

namespace ressort {

// Both are the caller's until the command has run; `code` is what it ended with.
void add_modes(CLI::App& app, ModesOptions& options, int& code);

}  // namespace ressort
