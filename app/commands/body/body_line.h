// app/commands: the command line of `body`.
#pragma once

#include "app/commands/body/body.h"
#include "app/commands/command_line.h"

namespace ressort {

// The options outlive the parsing; the exit code comes back in `code`. [main]
void add_body(CLI::App& app, BodyRequest& request, int& code);

}  // namespace ressort
