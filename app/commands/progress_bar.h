// app/commands: a progress bar on one line of the terminal.
#pragma once

#include <string>

#include "app/rooms.h"

namespace ressort::commands {

class ProgressBar {
 public:
  // Shows nothing if stderr is not a terminal.
  explicit ProgressBar(bool is_wanted);
  ~ProgressBar();  // clears the line
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  // Shows the finished share, 0..1, and the current task. Never blocks. [one thread]
  void show(double share, const std::string& what);

 private:
  bool is_shown_;
  std::string shown_;
};

}  // namespace ressort::commands
