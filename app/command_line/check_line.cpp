#include <string>

#include "app/command_line/command_lines.h"
#include "app/command_line/options.h"

namespace ressort::command_line {
namespace {

const char* const check_examples =
    "Every problem is told at once, as FILE:LINE:COLUMN: error|warning: what, and what was\n"
    "expected; then what the model has, how it will be computed, and whether it is stable.\n"
    "Examples:\n"
    "  ressort check my.mdl\n"
    "  ressort check my.mdl --json\n"
    "  ressort check old.mdl --print > new.mdl\n";

}  // namespace

void add_check(CLI::App& app, CheckOptions& options, int& code) {
  CLI::App* command =
      app.add_subcommand("check", "reads a model or a preset and says what it found");
  command->footer(check_examples);
  command->add_option("FILE", options.name, "a file, or a preset's or model's name")->required();
  CLI::Option* json = command->add_flag_callback(
      "--json", [&options] { options.as = CheckAs::json; }, "for machines, errors included");
  command
      ->add_flag_callback(
          "--print", [&options] { options.as = CheckAs::model; },
          "nothing but the model, as text in one clean dialect")
      ->excludes(json);
  add_motion(*command, options.third);
  add_method(*command, options.method);
  add_budget(*command, options.budget);
  add_strict(*command, options.is_strict);
  command->callback([&options, &code] { code = check(options); });
}

}  // namespace ressort::command_line
