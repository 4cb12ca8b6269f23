// app/control: the terminal that commands are typed at, on a thread of its own.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "app/control/console.h"

namespace ressort::control {

// Reads lines from the terminal with editing and history until the end of input or `quit`; then
// calls `on_quit`, on its own thread, only if it was `quit`. Without a terminal it reads plain
// lines and shows no prompt. Installs no signal handler. The destructor interrupts it, waiting for
// a command that is at work, and leaves the terminal as it was; it must come before the console's
// and the session's.
class Terminal {
 public:
  Terminal(Console& console, std::function<void()> on_quit);
  ~Terminal();

  // Prints a line without harm to what is being typed. [any thread but audio]
  void say(const std::string& text);

 private:
  struct Input;
  std::unique_ptr<Input> input_;
};

}  // namespace ressort::control
