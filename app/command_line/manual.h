// app/command_line: what an installed program has beside it, printed from its own tables.
#pragma once

#include <CLI/CLI.hpp>

#include "app/rooms.h"

namespace ressort::command_line {

// The manual page ressort(1), for man; of all commands of `app`, of the console and of OSC.
int print_man(const CLI::App& app);

// What bash completes after "ressort": commands, options, their words, presets, models and files.
int print_completion(const CLI::App& app);

// Every preset and model by its name, a line each.
int print_names();

}  // namespace ressort::command_line
