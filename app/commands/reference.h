// app/commands: prints the tables of the manual, generated from the program's own tables.
#pragma once

#include <span>
#include <string_view>

#include "app/rooms.h"

namespace ressort::commands {

struct ReferencePart {
  std::string_view name;
  std::string_view lists;
  void (*print)();  // prints a Markdown table
};
std::span<const ReferencePart> reference_parts();

// Prints the part `name`. Returns the exit code.
int reference(std::string_view name);

}  // namespace ressort::commands
