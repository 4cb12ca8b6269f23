// app/session: progress messages of long loads.
#pragma once

#include <chrono>
#include <exception>
#include <functional>
#include <string>
#include <string_view>

#include "app/rooms.h"

namespace ressort::session {

// Receives messages for a person.
using MessageHandler = std::function<void(const std::string&)>;

// Reports the stage of a load after one second and then every two seconds. [one thread]
class LoadProgress {
 public:
  LoadProgress(std::string name, MessageHandler on_message);

  void at(std::string_view stage);

 private:
  using Clock = std::chrono::steady_clock;
  std::string name_;
  MessageHandler on_message_;
  Clock::time_point start_ = Clock::now();
  Clock::time_point next_ = start_ + std::chrono::seconds(1);
};

// Returns the message for a person; running out of memory has a message of its own.
std::string describe(const std::exception& error);

}  // namespace ressort::session
