// app/realtime: what happens again and again is told once in a while, and how often it was.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "app/rooms.h"

namespace ressort::realtime {

// The first time is told at once; what follows within the interval is counted, and told at its end.
class RateLimit {
 public:
  using Clock = std::chrono::steady_clock;
  explicit RateLimit(Clock::duration interval = std::chrono::seconds(5)) : interval_(interval) {}

  // It happened, so many times more.
  void add(std::string text, std::uint64_t times = 1) {
    text_ = std::move(text);
    times_ += times;
  }

  // What there is to say by now: the newest text, "(and 412 more)" behind it.
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
