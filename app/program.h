// app: setup and error handling shared by all programs.
#pragma once

namespace ressort {

// Runs work(argc, argv) and returns its exit code, or another one if its output could not be
// written. Prints an exception and returns an exit code for it.
int run_program(int (*work)(int argc, char** argv), int argc, char** argv);

}  // namespace ressort
