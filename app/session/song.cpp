#include "app/session/song.h"

#include <algorithm>
#include <cmath>

#include "app/text.h"
#include "core/model/language/expression.h"

namespace ressort::session {

double TempoMap::time_of(double beat) const {
  const auto next = std::partition_point(tempos.begin() + 1, tempos.end(),
                                         [&](const Tempo& row) { return row.beat <= beat; });
  const Tempo& row = *(next - 1);
  return row.time_s + (beat - row.beat) * 60.0 / row.beats_per_minute;
}

double TempoMap::beats_per_minute_at(double time_s) const {
  const auto next = std::partition_point(tempos.begin() + 1, tempos.end(),
                                         [&](const Tempo& row) { return row.time_s <= time_s; });
  return (next - 1)->beats_per_minute;
}

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
  is_led_ = is_led_ && !is_jump;
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
  return change(false, [&](State&) {
    follows_clock_ = true;
    known_jumps_.reset();
  });
}

// A clock that rolls when it is first followed leads as if it had just started. A message is played
// a period after its time, so the place is that of a period before.
void Song::clock(const Meters& now, const ClockReading& reading) {
  constexpr double least_change = 1e-4;  // of the tempo
  constexpr double least_error_s = 1e-3;
  const std::lock_guard lock(mutex_);
  if (!follows_clock_ || length_s_ < 0.0 || reading.rate_hz <= 0.0) {
    return;
  }
  const SongPlace& place = now.song;
  const auto frames = static_cast<double>(place.frame - reading.frame - reading.period);
  const Clock::time_point at(
      std::chrono::nanoseconds(reading.time_ns + std::llround(1e9 * frames / reading.rate_hz)));
  const double at_s =
      std::min(place.in_beats ? tempos_.time_of(place.position) : place.position, length_s_);
  const bool jumps = known_jumps_ ? *known_jumps_ != place.jumps : place.rolls;
  known_jumps_ = place.jumps;
  is_led_ = jumps ? place.rolls : is_led_ && place.rolls;
  const double here_s = jumps ? at_s : state_.position_s(Clock::now());
  const double tempo =
      is_led_ && !place.in_beats ? 1.0 : now.tempo / tempos_.beats_per_minute_at(here_s);
  const bool has_new_tempo = tempo >= least_tempo && tempo <= most_tempo &&
                             std::fabs(tempo - state_.tempo) > least_change * state_.tempo;
  const bool is_wrong =
      jumps || (is_led_ && state_.plays && std::fabs(state_.position_s(at) - at_s) > least_error_s);
  if (!has_new_tempo && !is_wrong) {
    return;
  }
  begin_change();
  state_.tempo = has_new_tempo ? tempo : state_.tempo;
  if (is_wrong) {
    state_.at_s = at_s;
    state_.at = at;
  }
  if (jumps) {
    ++state_.jumps;
    state_.plays = place.rolls;
    is_over_ = false;
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

void Song::begin(double length_s, TempoMap tempos, bool is_paused) {
  const std::lock_guard lock(mutex_);
  tempos_ = std::move(tempos);
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
    is_led_ = false;
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
