// app/commands: options that several commands have.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>

#include "core/model/network.h"

namespace ressort {

// A number within a range; what is no number is in none.
CLI::Validator within(double least, double most);

// Whether a file that is there is written over.
void add_overwrite(CLI::App& command, bool& force);

// What the last argument of a mass means, for every command that reads a model.
void add_motion(CLI::App& command, std::optional<ThirdArgument>& third);

}  // namespace ressort
