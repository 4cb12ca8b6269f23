#include "app/command_line/command_line.h"

#include <cstdio>
#include <cstdlib>
#include <string>

#include "app/command_line/command_lines.h"
#include "app/commands/commands.h"
#include "app/exit_code.h"
#include "app/version.h"

namespace ressort::command_line {

int run_command_line(int argc, char** argv) {
  CLI::App app{"ressort simulates networks of masses and springs and plays them live."};
  app.footer(
      "Start with 'ressort play', then type 'help' at its prompt.\n"
      "'ressort COMMAND --help' explains a command.\n"
      "Exit codes: 0 success, 1 failure, 2 wrong arguments or unreadable input, 75 no audio.");
  app.set_version_flag("-V,--version", std::string("ressort ") + version + ", commit " + commit);
  app.name("ressort");
  app.require_subcommand(0, 1);
  int code = exit_code::done;
  for (const auto add : {add_play, add_render, add_check, add_make, add_export, add_modes,
                         add_describe, add_shape, add_body, add_chart, add_reference}) {
    add(app, code);
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? exit_code::done : exit_code::wrong_use;
  }
  if (app.get_subcommands().empty() && std::getenv("NSM_URL") != nullptr) {
    return play(PlayOptions());  // session managers start programs without arguments
  }
  if (app.get_subcommands().empty()) {
    std::fprintf(stderr, "%s", app.help().c_str());
    return exit_code::wrong_use;
  }
  return code;
}

}  // namespace ressort::command_line
