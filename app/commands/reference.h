// app/commands: prints the tables of the manual from those that the program itself reads. The exit
// code comes back.
#pragma once

#include <span>
#include <string_view>

#include "app/rooms.h"

namespace ressort::commands {

struct ReferencePart {
  std::string_view name;
  std::string_view lists;
  void (*print)();  // to stdout, as a table in Markdown
};
std::span<const ReferencePart> reference_parts();

// `name` is that of a part.
int reference(std::string_view name);

}  // namespace ressort::commands
