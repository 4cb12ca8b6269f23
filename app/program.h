// app: what every program of ours does around its work.
#pragma once

namespace ressort {

// Runs work(argc, argv), whose exit code comes back, unless what it said could not be written. An
// exception becomes a line and an exit code.
int run_program(int (*work)(int argc, char** argv), int argc, char** argv);

}  // namespace ressort
