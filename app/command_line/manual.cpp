#include "app/command_line/manual.h"

#include <algorithm>
#include <cstdio>
#include <string>
#include <string_view>
#include <vector>

#include "app/control/registry.h"
#include "app/exit_code.h"
#include "app/session/files.h"
#include "app/version.h"

namespace ressort::command_line {
namespace {

// As roff reads it: no word of ours is one of its own.
std::string roff(std::string_view text) {
  std::string out;
  bool begins = true;
  for (const char c : text) {
    if (begins && (c == '.' || c == '\'')) {
      out += "\\&";
    }
    out += c == '\\' ? std::string("\\e") : c == '-' ? "\\-" : std::string(1, c);
    begins = c == '\n';
  }
  return out;
}

void put(const std::string& line) {
  std::puts(line.c_str());
}

std::vector<const CLI::App*> commands_of(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App*) { return true; });
}

std::vector<const CLI::Option*> options_of(const CLI::App& command) {
  return command.get_options(
      [](const CLI::Option* option) { return !option->get_group().empty(); });
}

// "-a", "--audio".
std::vector<std::string> names_of(const CLI::Option& option) {
  std::vector<std::string> names;
  for (const std::string& name : option.get_snames()) {
    names.push_back("-" + name);
  }
  for (const std::string& name : option.get_lnames()) {
    names.push_back("--" + name);
  }
  return names;
}

bool takes_value(const CLI::Option& option) {
  return option.get_items_expected_max() > 0;
}

// The words that it takes, where these are all: "WORD:{a,b}".
std::vector<std::string> choices_of(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  const std::size_t open = type.find('{');
  const std::size_t close = type.find('}', open);
  std::vector<std::string> choices;
  if (open == type.npos || close == type.npos) {
    return choices;
  }
  for (std::size_t at = open + 1; at < close;) {
    const std::size_t end = std::min(type.find(',', at), close);
    // Of a word that stands for a number, "direct->0", the word.
    const std::string word = type.substr(at, end - at);
    choices.push_back(word.substr(0, word.find("->")));
    at = end + 1;
  }
  return choices;
}

void put_option(const CLI::Option& option) {
  put(".TP");
  std::string head;
  for (const std::string& name : names_of(option)) {
    head += (head.empty() ? "\\fB" : ", \\fB") + roff(name) + "\\fR";
  }
  if (head.empty()) {
    head = "\\fI" + roff(option.get_name(true)) + "\\fR";
  } else if (takes_value(option)) {
    head += " \\fI" + roff(option.get_type_name()) + "\\fR";
  }
  put(head);
  put(roff(option.get_description()));
}

void put_row(std::string_view name, std::string_view arguments, std::string_view does) {
  put(".TP");
  put("\\fB" + roff(name) + "\\fR \\fI" + roff(arguments) + "\\fR");
  put(roff(does));
}

std::string joined_names(const CLI::App& command) {
  std::string all;
  for (const CLI::Option* const option : options_of(command)) {
    for (const std::string& name : names_of(*option)) {
      all += (all.empty() ? "" : " ") + name;
    }
  }
  return all;
}

}  // namespace

int print_man(const CLI::App& app) {
  put(".TH RESSORT 1 \"\" \"ressort " + std::string(version) + "\" \"User Commands\"");
  put(".SH NAME\nressort \\- real\\-time mass\\-interaction synthesizer");
  put(".SH SYNOPSIS\n.B ressort\n.I COMMAND\n.RI [ OPTIONS ]");
  put(".SH DESCRIPTION");
  put("Plays networks of masses and springs, read from .mdl files: strings, meshes, bodies and "
      "what");
  put("strikes, plucks and bows them. It plays on JACK, PipeWire and ALSA, by MIDI and by OSC, "
      "and");
  put("has a console; it renders to files, and says what is wrong with a model.");
  put(".PP\nStarted by a session manager (NSM_URL is set) and without a command, it plays.");
  put(".SH COMMANDS");
  for (const CLI::App* const command : commands_of(app)) {
    if (command->get_name() == "reference") {
      continue;  // for who writes documents
    }
    put(".SS ressort " + roff(command->get_name()));
    put(roff(command->get_description()));
    for (const CLI::Option* const option : options_of(*command)) {
      put_option(*option);
    }
  }
  put(".SH CONSOLE\nWhile it plays, it reads commands.");
  for (const Row* const row : command_rows()) {
    put_row(row->command, row->words, row->command_does);
  }
  put(".SH OSC\nUDP port 9777 of this machine, unless options say otherwise.");
  for (const Row* const row : addresses()) {
    put_row(row->address, row->arguments_text(), row->does);
  }
  put(".SH EXIT STATUS\n.TP\n0\ndone\n.TP\n1\nour failure: a full disk, an interrupted render");
  put(".TP\n2\nwrong use, or a file that cannot be read\n.TP\n75\nno audio, or none any more");
  put(".SH ENVIRONMENT\n.TP\nRESSORT_DATA\na folder with models and presets, instead of those "
      "that");
  put("were installed\n.TP\nNSM_URL\nthe session manager that it belongs to");
  put(".TP\nNO_COLOR\nerrors are not in colour");
  put(".SH FILES\n.TP\n$XDG_DATA_HOME/ressort, ~/.local/share/ressort");
  put("models, presets and flights of the user's");
  put(".SH SEE ALSO\n.BR jackd (1),\n.BR aplay (1)");
  return exit_code::done;
}

int print_completion(const CLI::App& app) {
  std::string words;
  for (const CLI::App* const command : commands_of(app)) {
    words += (words.empty() ? "" : " ") + command->get_name();
  }
  put("# bash completion for ressort; printed by 'ressort reference completion'");
  put("_ressort() {");
  put("  local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]} options choices=");
  put("  COMPREPLY=()");
  put("  if [ \"$COMP_CWORD\" -eq 1 ]; then");
  put("    mapfile -t COMPREPLY < <(compgen -W '" + words + " --help --version' -- \"$word\")");
  put("    return");
  put("  fi");
  put("  case ${COMP_WORDS[1]} in");
  for (const CLI::App* const command : commands_of(app)) {
    put("    " + command->get_name() + ")");
    put("      options='" + joined_names(*command) + "'");
    put("      case $before in");
    for (const CLI::Option* const option : options_of(*command)) {
      std::string names;
      for (const std::string& name : names_of(*option)) {
        names += (names.empty() ? "" : "|") + name;
      }
      std::string choices;
      for (const std::string& choice : choices_of(*option)) {
        choices += (choices.empty() ? "" : " ") + choice;
      }
      if (!names.empty() && !choices.empty()) {
        put("        " + names + ") choices='" + choices + "' ;;");
      }
    }
    put("      esac ;;");
  }
  put("    *) return ;;");
  put("  esac");
  put("  if [ -n \"$choices\" ]; then");
  put("    mapfile -t COMPREPLY < <(compgen -W \"$choices\" -- \"$word\")");
  put("  elif [ \"${word#-}\" != \"$word\" ]; then");
  put("    mapfile -t COMPREPLY < <(compgen -W \"$options\" -- \"$word\")");
  put("  else");
  put("    mapfile -t COMPREPLY < <(");
  put("      compgen -W \"$(\"${COMP_WORDS[0]}\" reference names 2> /dev/null)\" -- \"$word\"");
  put("      compgen -f -- \"$word\"");
  put("    )");
  put("    compopt -o filenames 2> /dev/null");
  put("  fi");
  put("}");
  put("complete -F _ressort ressort");
  return exit_code::done;
}

int print_names() {
  for (const std::string& name : known_presets()) {
    put(name);
  }
  for (const std::string& name : known_models()) {
    put(name);
  }
  return exit_code::done;
}

}  // namespace ressort::command_line
