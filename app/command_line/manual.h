// app/command_line: the manual page and the completion for bash, generated from the options.
#pragma once

#include <CLI/CLI.hpp>

#include "app/rooms.h"

namespace ressort::command_line {

// Prints the manual page ressort(1): the --help of every command.
int print_man(const CLI::App& app);

// Prints a completion for bash: commands, options, presets, models and files.
int print_completion(const CLI::App& app);

// Prints the names of all presets and models, one per line.
int print_names();

}  // namespace ressort::command_line
