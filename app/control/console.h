// app/control: the console: parses, completes and executes the commands of registry.h. terminal.h
// reads the lines.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "app/session/session.h"
#include "core/result.h"

namespace ressort::control {

// A parsed command: its full name and its words. Pure.
struct Command {
  std::string name;
  std::vector<std::string> words;
};

struct ConsoleContext;

// Parses a line. Accepts unique abbreviations of command names, "..." for a word with blanks, and #
// comments. An empty line gives a command without a name. The error suggests a command, or lists
// the words that the command takes.
Result<Command> parse_command(std::string_view line);

// Returns the last word of a line with its quote; empty at the end and after a blank.
std::string_view last_word(std::string_view line);

// A keyboard in raw mode: calls `on_key` for each key, and with 0 when none has come for a second,
// until `on_key` returns false or the input ends.
using Keyboard = std::function<void(const std::function<bool(char key)>& on_key)>;

// Executes commands. Output and errors go to `print`, one or more lines at a time, without the last
// line end. Process and session must outlive it.
class Console {
 public:
  using Print = std::function<void(const std::string&)>;
  Console(Process& process, Session& session, Print print, Print report);
  ~Console();

  // Return false if the command was `quit`. [console thread]
  bool run(const Command& command);
  bool run_line(std::string_view line);

  // Runs a file of commands; stops at `quit` and at the first command that fails, whose error has
  // the file, the line and the column. [console thread]
  Result<Done> run_script(const std::string& path);

  // Returns whether `quit` was executed. [console thread]
  bool has_quit() const;

  // Sets the keyboard of the command `keys`, which fails without a keyboard.
  void set_keyboard(Keyboard keyboard);

  // Returns the words that could complete the last word of `line`: commands, parameters, presets,
  // models, files. A folder ends in '/'. [console thread]
  std::vector<std::string> completions(std::string_view line) const;

 private:
  std::unique_ptr<ConsoleContext> context_;
};

}  // namespace ressort::control
