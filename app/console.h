// app: the small console, on a thread of its own.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "app/recorder.h"
#include "app/session.h"
#include "core/result.h"

namespace ressort {

// A command as typed, resolved: its full name and its words. Pure.
struct Command {
  std::string name;
  std::vector<std::string> words;
};

// One row for every command: the parser, the help and the completion read this table.
struct CommandRow {
  std::string_view name;
  std::string_view arguments;
  std::string_view does;
};
std::span<const CommandRow> commands();

// Accepts unique beginnings of command names. An empty line or a # comment gives a command
// without a name. The error names what could have been meant.
Result<Command> parse_command(std::string_view line);

// Carries out commands. What it has to say goes to `print`, a line or more at a time.
class Console {
 public:
  using Print = std::function<void(const std::string&)>;
  Console(Process& process, Session& session, Print print);
  ~Console();

  // False: the command was to quit. [console thread]
  bool run(const Command& command);
  bool run_line(std::string_view line);

  // Runs a file of commands; stops at the first that fails.
  Result<Done> run_script(const std::string& path);

  // Words that could stand where the last one of `line` does: commands, parameters, files.
  std::vector<std::string> completions(std::string_view line) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// Reads lines from the terminal with editing and history until the end of input or `quit`; then
// calls `on_quit` only if it was `quit`. Without a terminal it reads plain lines and shows no
// prompt. The destructor interrupts it.
class Terminal {
 public:
  Terminal(Console& console, std::function<void()> on_quit);
  ~Terminal();

  // Prints a line from another thread without harm to what is being typed.
  void say(const std::string& text);

 private:
  struct Input;
  std::unique_ptr<Input> input_;
};

}  // namespace ressort
