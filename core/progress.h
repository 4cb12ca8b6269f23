// core: how long work says what it is at, and hears that nobody waits for it any more.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string_view>
#include <utility>

namespace ressort {

// Thrown by a Progress whose work shall stop. It passes through core's rooms; the outer doors,
// parse_network() and compile_network(), catch it and fail with the message `stopped`.
struct Stopped {};
inline constexpr const char* stopped = "stopped";

// Of one piece of work, shared by its copies. Without a GoOn nobody looks on, and it costs nothing.
// [the thread that works]
class Progress {
 public:
  // Gets what is being done ("finding the lowest mode"), at every stage and every few milliseconds;
  // answers false to stop it.
  using GoOn = std::function<bool(std::string_view stage)>;

  Progress() = default;
  explicit Progress(GoOn go_on, std::uint64_t steps_per_look = std::uint64_t{1} << 17)
      : state_(std::make_shared<State>(State{std::move(go_on), steps_per_look, steps_per_look})) {}

  // What begins now; the text is kept, not copied.
  void stage(std::string_view name) const {
    if (state_) {
      state_->stage = name;
      look();
    }
  }

  // So many more elements were visited, each in about 10 ns.
  void spend(std::size_t steps) const {
    if (state_ && (state_->steps += steps) >= state_->next_look) {
      look();
    }
  }

  // All that was spent.
  std::uint64_t steps() const { return state_ ? state_->steps : 0; }

 private:
  struct State {
    GoOn go_on;
    std::uint64_t steps_per_look;
    std::uint64_t next_look;
    std::uint64_t steps = 0;
    std::string_view stage = {};
  };

  void look() const {
    state_->next_look = state_->steps + state_->steps_per_look;
    if (!state_->go_on(state_->stage)) {
      throw Stopped();
    }
  }

  std::shared_ptr<State> state_;
};

}  // namespace ressort
