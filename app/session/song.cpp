#include "app/session/song.h"

#include <algorithm>
#include <cmath>

#include "app/text.h"
#include "core/model/language/expression.h"

namespace ressort::session {

double Song::State::position_s(Clock::time_point now) const {
  return plays ? at_s + tempo * std::chrono::duration<double>(now - at).count() : at_s;
}

Song::Clock::time_point Song::State::time_of(double position_s) const {
  return at + std::chrono::duration_cast<Clock::duration>(
                  std::chrono::duration<double>((position_s - at_s) / tempo));
}

Result<Done> Song::change(bool is_jump, const std::function<void(State&)>& what) {
  const std::lock_guard lock(mutex_);
  if (length_s_ < 0.0) {
    return Error{"no MIDI file was given; 'ressort play MODEL --midi FILE' plays one"};
  }
  begin_change();
  what(state_);
  state_.jumps += is_jump ? 1 : 0;
  return Done{};
}

// Holds the position at this moment, and wakes the player once the lock is released.
void Song::begin_change() {
  const auto now = Clock::now();
  state_.at_s = std::min(state_.position_s(now), length_s_);
  state_.at = now;
  ++state_.changes;
  wake_.notify_all();
}

Result<Done> Song::play(std::optional<double> from_s) {
  if (from_s && !(*from_s >= 0.0 && *from_s <= 86400.0)) {
    return Error{"expected the second to play from, at most a day"};
  }
  return change(true, [&](State& state) {
    state.at_s = std::min(from_s.value_or(is_over_ ? 0.0 : state.at_s), length_s_);
    state.plays = true;
    is_over_ = false;
  });
}

Result<Done> Song::pause() {
  return change(true, [](State& state) { state.plays = false; });
}

Result<Done> Song::set_tempo(double tempo) {
  if (!(tempo >= least_tempo && tempo <= most_tempo)) {
    return Error{"the tempo must lie between " + print_number(100.0 * least_tempo) + " and " +
                 print_number(100.0 * most_tempo) + " %"};
  }
  return change(false, [&](State& state) {
    state.tempo = tempo;
    follows_clock_ = false;
  });
}

Result<Done> Song::follow_clock() {
  return change(false, [&](State&) { follows_clock_ = true; });
}

void Song::clock(double beats_per_minute) {
  constexpr double least_change = 1e-4;
  const std::lock_guard lock(mutex_);
  const double tempo = beats_per_minute / beats_per_minute_;
  if (follows_clock_ && tempo >= least_tempo && tempo <= most_tempo &&
      std::fabs(tempo - state_.tempo) > least_change * state_.tempo) {
    begin_change();
    state_.tempo = tempo;
  }
}

Result<Done> Song::loop(double from_s, double to_s) {
  constexpr double shortest_s = 0.01;
  if (from_s != to_s && !(from_s >= 0.0 && to_s >= from_s + shortest_s && to_s <= 86400.0)) {
    return Error{"a loop needs its first and its last second, at least 0.01 s apart"};
  }
  return change(false, [&](State& state) {
    state.loop_from_s = from_s;
    state.loop_to_s = to_s;
  });
}

bool Song::is_over() const {
  const std::lock_guard lock(mutex_);
  return is_over_;
}

std::string Song::description() const {
  const std::lock_guard lock(mutex_);
  std::string text = (state_.plays ? "playing at " : "paused at ") +
                     fixed(std::min(state_.position_s(Clock::now()), length_s_), 1) + " of " +
                     fixed(length_s_, 1) + " s, tempo " + fixed(100.0 * state_.tempo, 0) + " %" +
                     (follows_clock_ ? " by the clock" : "");
  if (state_.loop_to_s > state_.loop_from_s) {
    text += ", loop from " + print_number(state_.loop_from_s) + " to " +
            print_number(state_.loop_to_s) + " s";
  }
  return is_over_ ? "the end, after " + fixed(length_s_, 1) + " s" : text;
}

void Song::begin(double length_s, double beats_per_minute, bool is_paused) {
  const std::lock_guard lock(mutex_);
  beats_per_minute_ = beats_per_minute;
  length_s_ = length_s;
  state_.plays = !is_paused;
  state_.at = Clock::now();
  ++state_.changes;
}

Song::State Song::state() const {
  const std::lock_guard lock(mutex_);
  return state_;
}

bool Song::wait_until(Clock::time_point time, const State& known) {
  std::unique_lock lock(mutex_);
  return !wake_.wait_until(lock, time, [&] { return state_.changes != known.changes; });
}

void Song::wait(const State& known) {
  std::unique_lock lock(mutex_);
  wake_.wait(lock, [&] { return state_.changes != known.changes; });
}

void Song::go_back(const State& known) {
  const std::lock_guard lock(mutex_);
  if (state_.changes == known.changes) {
    state_.at = state_.time_of(state_.loop_to_s);
    state_.at_s = state_.loop_from_s;
    ++state_.jumps;
    ++state_.changes;
  }
}

void Song::end(const State& known) {
  const std::lock_guard lock(mutex_);
  if (state_.changes == known.changes) {
    state_.plays = false;
    state_.at_s = length_s_;
    is_over_ = true;
    ++state_.changes;
  }
}

void Song::wake() {
  const std::lock_guard lock(mutex_);
  ++state_.changes;
  wake_.notify_all();
}

}  // namespace ressort::session
