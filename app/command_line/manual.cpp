#include "app/command_line/manual.h"

#include <cstdio>
#include <string>
#include <vector>

#include "app/exit_code.h"
#include "app/session/files.h"
#include "app/version.h"

namespace ressort::command_line {
namespace {

std::vector<const CLI::App*> commands_of(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App*) { return true; });
}

// Prints preformatted text. Roff gives a meaning to backslashes, to hyphens, and to a dot or a
// quote at the start of a line.
void print_verbatim(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if ((out.empty() || out.back() == '\n') && (c == '.' || c == '\'')) {
      out += "\\&";
    }
    out += c == '\\' ? std::string("\\e") : c == '-' ? "\\-" : std::string(1, c);
  }
  std::printf(".EX\n%s\n.EE\n", out.c_str());
}

}  // namespace

int print_man(const CLI::App& app) {
  std::printf(
      ".TH RESSORT 1 \"\" \"ressort %s\" \"User Commands\"\n"
      ".SH NAME\nressort \\- real\\-time mass\\-interaction synthesizer\n"
      ".SH SYNOPSIS\n.B ressort\n.I COMMAND\n.RI [ OPTIONS ]\n"
      ".SH DESCRIPTION\n"
      "Simulates networks of masses and springs and plays them live, on JACK, PipeWire and ALSA, "
      "by\n"
      "MIDI and by OSC. While it plays, it reads console commands; type \\(lqhelp\\(rq for a "
      "list.\n",
      version);
  for (const CLI::App* const command : commands_of(app)) {
    std::printf(".SH ressort %s\n", command->get_name().c_str());
    print_verbatim(command->help("ressort"));
  }
  std::printf(
      ".SH EXIT STATUS\n.TP\n0\nsuccess\n.TP\n1\nfailure, such as a full disk or an interrupted\n"
      "render\n.TP\n2\nwrong arguments, or an unreadable file\n.TP\n75\nno audio\n"
      ".SH ENVIRONMENT\n.TP\nRESSORT_DATA\nfolder with models and presets, instead of the "
      "installed\n"
      "ones\n.TP\nNSM_URL\nsession manager that started the program\n"
      ".TP\nNO_COLOR\ndisables colours\n"
      ".SH FILES\n.TP\n$XDG_DATA_HOME/ressort, ~/.local/share/ressort\nmodels, presets and flights "
      "of the\n"
      "user\n"
      ".TP\n$XDG_CONFIG_HOME/ressort/controllers.toml\nthe user's mapping of controllers\n"
      ".SH SEE ALSO\n.BR jackd (1),\n.BR gnuplot (1)\n");
  return exit_code::done;
}

int print_completion(const CLI::App& app) {
  std::string words;
  std::string cases;
  for (const CLI::App* const command : commands_of(app)) {
    words += command->get_name() + " ";
    cases += "    " + command->get_name() + ") options='";
    for (const CLI::Option* const option : command->get_options()) {
      for (const std::string& name : option->get_lnames()) {
        cases += "--" + name + " ";
      }
    }
    cases += "' ;;\n";
  }
  std::printf(
      "# bash completion for ressort; printed by 'ressort reference completion'\n"
      "_ressort() {\n"
      "  local word=${COMP_WORDS[COMP_CWORD]} options=\n"
      "  case ${COMP_WORDS[1]} in\n%s  esac\n"
      "  if [ \"$COMP_CWORD\" -eq 1 ]; then\n"
      "    options='%s--help --version'\n"
      "  elif [ \"${word#-}\" = \"$word\" ]; then\n"
      "    options=$(\"${COMP_WORDS[0]}\" reference names 2> /dev/null)\n"
      "    mapfile -t COMPREPLY < <(compgen -W \"$options\" -- \"$word\"; compgen -f -- "
      "\"$word\")\n"
      "    compopt -o filenames 2> /dev/null\n"
      "    return\n"
      "  fi\n"
      "  mapfile -t COMPREPLY < <(compgen -W \"$options\" -- \"$word\")\n"
      "}\n"
      "complete -F _ressort ressort\n",
      cases.c_str(), words.c_str());
  return exit_code::done;
}

int print_names() {
  for (const std::vector<std::string>& names : {known_presets(), known_models()}) {
    for (const std::string& name : names) {
      std::puts(name.c_str());
    }
  }
  return exit_code::done;
}

}  // namespace ressort::command_line
