// app/realtime: limits how often a repeated message is printed.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "app/rooms.h"

namespace ressort::realtime {

// Passes the first message at once. Messages within the interval after it are counted, and the
// newest is passed at the end of the interval.
class RateLimit {
 public:
  using Clock = std::chrono::steady_clock;
  explicit RateLimit(Clock::duration interval = std::chrono::seconds(5)) : interval_(interval) {}

  // Records `times` occurrences.
  void add(std::string text, std::uint64_t times = 1) {
    text_ = std::move(text);
    times_ += times;
  }

  // Returns the message that is due: the newest text, followed by "(and 412 more)".
  std::optional<std::string> take(Clock::time_point now = Clock::now()) {
    if (times_ == 0 || now < next_) {
      return std::nullopt;
    }
    next_ = now + interval_;
    const std::uint64_t more = std::exchange(times_, 0) - 1;
    return text_ + (more > 0 ? " (and " + std::to_string(more) + " more)" : "");
  }

 private:
  Clock::duration interval_;
  Clock::time_point next_{};
  std::string text_;
  std::uint64_t times_ = 0;
};

}  // namespace ressort::realtime
