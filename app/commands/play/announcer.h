// app/commands: messages of the program while it plays.
#pragma once

#include <mutex>
#include <string>

#include "app/control/terminal.h"
#include "app/say.h"

namespace ressort::commands {

// Prints messages above the console's prompt, if there is one.
class Announcer {
 public:
  void say(const std::string& text) {
    const std::lock_guard lock(mutex_);
    if (terminal_ != nullptr) {
      terminal_->say(text);
    } else {
      ressort::say(text);
    }
  }
  void set_terminal(Terminal* terminal) {
    const std::lock_guard lock(mutex_);
    terminal_ = terminal;
  }

 private:
  std::mutex mutex_;
  Terminal* terminal_ = nullptr;
};

}  // namespace ressort::commands
