// app/control: the terminal, which reads commands on a thread of its own.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "app/control/console.h"

namespace ressort::control {

// Reads lines with editing and history until the end of input or `quit`; after `quit` only, calls
// `on_quit` on its own thread. Without a terminal it reads plain lines and prints no prompt.
// Installs no signal handler. The destructor interrupts it, waits for a running command and
// restores the terminal; it must run before those of the console and the session.
class Terminal {
 public:
  Terminal(Console& console, std::function<void()> on_quit);
  ~Terminal();

  // Prints a line without disturbing the line being typed. [any thread but audio]
  void say(const std::string& text);

 private:
  struct Input;
  std::unique_ptr<Input> input_;
};

}  // namespace ressort::control
