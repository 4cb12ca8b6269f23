// app/commands: how far a command is, in a line of a terminal that is written over.
#pragma once

#include <string>

#include "app/rooms.h"

namespace ressort::commands {

class ProgressBar {
 public:
  // Shows nothing where stderr is no terminal, or nobody wants it.
  explicit ProgressBar(bool is_wanted);
  ~ProgressBar();  // the line is empty again
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  // `share` of 0..1 is done, and at what it is. Waits for no terminal. [one thread]
  void show(double share, const std::string& what);

 private:
  bool is_shown_;
  std::string shown_;
};

}  // namespace ressort::commands
