// app/command_line: the options of each command.
#pragma once

#include <CLI/CLI.hpp>

#include "app/rooms.h"

namespace ressort::command_line {

// Adds a command to the program. Parsing fills its options, runs the command and sets `code`, which
// must outlive `app`. [main]
void add_play(CLI::App& app, int& code);
void add_render(CLI::App& app, int& code);
void add_check(CLI::App& app, int& code);
void add_make(CLI::App& app, int& code);
void add_export(CLI::App& app, int& code);
void add_modes(CLI::App& app, int& code);
void add_describe(CLI::App& app, int& code);
void add_shape(CLI::App& app, int& code);
void add_body(CLI::App& app, int& code);
void add_chart(CLI::App& app, int& code);
void add_reference(CLI::App& app, int& code);

}  // namespace ressort::command_line
