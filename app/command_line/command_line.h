// app/command_line: the command line, turned into one of the commands.
#pragma once

#include "app/rooms.h"

namespace ressort::command_line {

// Reads what was said and does it; the exit code comes back. [main]
int run_command_line(int argc, char** argv);

}  // namespace ressort::command_line
