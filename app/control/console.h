// app/control: the small console: reads, completes and carries out the commands of registry.h.
// Where they are typed is terminal.h's.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "app/session/session.h"
#include "core/result.h"

namespace ressort::control {

// A command as typed, resolved: its full name and its words. Pure.
struct Command {
  std::string name;
  std::vector<std::string> words;
};

struct ConsoleContext;

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
  std::unique_ptr<ConsoleContext> context_;
};

}  // namespace ressort::control
