// app/commands: lists of numbers in options.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/rooms.h"

namespace ressort::commands {

// Parses N numbers between separators.
std::optional<std::vector<double>> numbers_of(const std::string& text, char separator = ',');

}  // namespace ressort::commands
