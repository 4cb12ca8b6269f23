// app/command_line: the command line, turned into one of the commands.
#pragma once

namespace ressort {

// Reads what was said and does it; the exit code comes back. [main]
int run_command_line(int argc, char** argv);

}  // namespace ressort
