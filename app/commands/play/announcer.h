// app/commands: messages of the program while it plays, and its forced exit.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdlib>
#include <mutex>
#include <string>
#include <thread>

#include "app/control/terminal.h"
#include "app/exit_code.h"
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

// Exits the process if a regular shutdown takes too long, for example in a library.
class LastResort {
 public:
  LastResort()
      : thread_([this] {
          std::unique_lock lock(mutex_);
          if (!over_.wait_for(lock, std::chrono::milliseconds(900), [this] { return is_over_; })) {
            std::_Exit(exit_code::done);
          }
        }) {}
  ~LastResort() {
    {
      const std::lock_guard lock(mutex_);
      is_over_ = true;
    }
    over_.notify_all();
    thread_.join();
  }

 private:
  std::mutex mutex_;
  std::condition_variable over_;
  bool is_over_ = false;
  std::thread thread_;
};

}  // namespace ressort::commands
