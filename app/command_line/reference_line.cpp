#include <string>
#include <vector>

#include "app/command_line/command_lines.h"
#include "app/command_line/manual.h"
#include "app/commands/reference.h"

namespace ressort::command_line {

void add_reference(CLI::App& app, std::string& part, int& code) {
  CLI::App* command = app.add_subcommand("reference", "prints a table of the manual");
  std::vector<std::string> names;
  std::string footer = "PART:";
  for (const ReferencePart& known : reference_parts()) {
    names.emplace_back(known.name);
    footer += "\n  " + names.back() + std::string(10 - names.back().size(), ' ') +
              std::string(known.lists);
  }
  command->footer(footer);
  // For who installs the program.
  names.insert(names.end(), {"man", "completion", "names"});
  command->add_option("PART", part, "which")->required()->check(CLI::IsMember(names));
  command->callback([&app, &part, &code] {
    code = part == "man"          ? print_man(app)
           : part == "completion" ? print_completion(app)
           : part == "names"      ? print_names()
                                  : reference(part);
  });
}

}  // namespace ressort::command_line
