// core: progress reports and cancellation of long work.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string_view>
#include <utility>

namespace ressort {

// Thrown by a Progress whose work is cancelled. It passes through core's rooms. parse_network() and
// compile_network() catch it and fail with the message `stopped`.
struct Stopped {};
inline constexpr const char* stopped = "stopped";

// The progress of one piece of work, shared by all copies. Without a callback it does nothing.
// [the thread that works]
class Progress {
 public:
  // Receives the current stage ("finding the lowest mode") at every new stage and every few
  // milliseconds. Returns false to cancel the work.
  using Callback = std::function<bool(std::string_view stage)>;

  Progress() = default;
  explicit Progress(Callback callback, std::uint64_t steps_per_report = std::uint64_t{1} << 17)
      : state_(std::make_shared<State>(
            State{std::move(callback), steps_per_report, steps_per_report})) {}

  // Starts a stage. The text is not copied.
  void stage(std::string_view name) const {
    if (state_) {
      state_->stage = name;
      report();
    }
  }

  // Adds visited elements, each of which takes about 10 ns.
  void spend(std::size_t steps) const {
    if (state_ && (state_->steps += steps) >= state_->next_report) {
      report();
    }
  }

  // Returns the sum of all elements.
  std::uint64_t steps() const { return state_ ? state_->steps : 0; }

 private:
  struct State {
    Callback callback;
    std::uint64_t steps_per_report;
    std::uint64_t next_report;
    std::uint64_t steps = 0;
    std::string_view stage = {};
  };

  void report() const {
    state_->next_report = state_->steps + state_->steps_per_report;
    if (!state_->callback(state_->stage)) {
      throw Stopped();
    }
  }

  std::shared_ptr<State> state_;
};

}  // namespace ressort
