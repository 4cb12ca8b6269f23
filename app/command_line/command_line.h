// app/command_line: parses the command line and runs a command.
#pragma once

#include "app/rooms.h"

namespace ressort::command_line {

// Parses the arguments and runs the command. Returns the exit code. [main]
int run_command_line(int argc, char** argv);

}  // namespace ressort::command_line
