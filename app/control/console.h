// app: the small console's commands. Where they are typed is terminal.h's.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "app/session/recorder.h"
#include "app/session/session.h"
#include "core/result.h"

namespace ressort {

// A command as typed, resolved: its full name and its words. Pure.
struct Command {
  std::string name;
  std::vector<std::string> words;
};

// What the commands work on; the console's own.
struct Desk;

// One row for every command: the parser, the help and the completion read this table.
struct CommandRow {
  std::string_view group;  // its heading in the help
  std::string_view name;
  std::string_view arguments;  // [X] may be left out; MODEL, PRESET, PARAMETER, COMMAND and FILE
                               // say what completes a word
  std::string_view does;       // one line
  std::string_view details;    // more lines, for `help NAME`
  Result<Done> (*act)(Desk& desk, std::span<const std::string> words);
};
std::span<const CommandRow> commands();

// Accepts unique beginnings of command names, "..." for a word with blanks in it, and # comments.
// An empty line gives a command without a name. The error names what could have been meant, or
// which words the command takes.
Result<Command> parse_command(std::string_view line);

// Where the last word of a line starts, quote and all; empty at the end and after a blank.
std::string_view last_word(std::string_view line);

// A keyboard without lines: calls `on_key` for each key, and with 0 when none has come for a
// second, until `on_key` answers false or the input ends.
using Keyboard = std::function<void(const std::function<bool(char key)>& on_key)>;

// Carries out commands. What it has to say goes to `print`, a line or more at a time, without the
// last line end. Errors go there too. Process and session must outlive it.
class Console {
 public:
  using Print = std::function<void(const std::string&)>;
  Console(Process& process, Session& session, Print print, Print tell);
  ~Console();

  // False: the command was to quit. [console thread]
  bool run(const Command& command);
  bool run_line(std::string_view line);

  // Runs a file of commands; stops at `quit` and at the first that fails, whose error has the
  // file, the line and the column. [console thread]
  Result<Done> run_script(const std::string& path);

  // Whether there was a command to quit. [console thread]
  bool has_quit() const;

  // The command `keys` plays from this keyboard; without one it fails.
  void lend_keyboard(Keyboard keyboard);

  // Words that could stand where the last one of `line` does: commands, parameters, presets,
  // models, files. A folder ends in '/'. [console thread]
  std::vector<std::string> completions(std::string_view line) const;

 private:
  std::unique_ptr<Desk> desk_;
};

}  // namespace ressort
