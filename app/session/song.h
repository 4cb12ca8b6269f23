// app/session: the position and the speed of a MIDI file that plays. No files, no MIDI.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "app/realtime/process.h"
#include "core/result.h"

namespace ressort::session {

// The tempos of a MIDI file, in their order; the first one is at the start.
struct TempoMap {
  struct Tempo {
    double beat = 0.0;
    double time_s = 0.0;
    double beats_per_minute = 120.0;
  };
  std::vector<Tempo> tempos{Tempo{}};

  double time_of(double beat) const;
  double beats_per_minute_at(double time_s) const;
};

class Song {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr double least_tempo = 0.1;
  static constexpr double most_tempo = 10.0;

  // The position is `at_s` at the time `at`, and from there, if it plays, `tempo` seconds of the
  // file a second. It repeats the seconds between the ends of the loop, if these differ.
  struct State {
    bool plays = false;
    double at_s = 0.0;
    Clock::time_point at;
    double tempo = 1.0;
    double loop_from_s = 0.0;
    double loop_to_s = 0.0;
    std::uint64_t jumps = 0;    // counts starts, pauses and jumps
    std::uint64_t changes = 0;  // counts all changes

    double position_s(Clock::time_point now) const;
    Clock::time_point time_of(double position_s) const;
  };

  // Commands. The error: there is no song, or a number is out of range. [any thread but audio]
  // Plays from this second, or from where it is; from the start if it is over.
  Result<Done> play(std::optional<double> from_s);
  Result<Done> pause();
  Result<Done> set_tempo(double tempo);           // 1 is the file's.
  Result<Done> follow_clock();                    // Tempo and position are those of clock().
  Result<Done> loop(double from_s, double to_s);  // The same number twice ends the loop.

  bool is_over() const;             // True from the end of the file on, until play().
  std::string description() const;  // Returns for example "12.5 of 180 s, tempo 80 %".

  // For the player. [its thread]
  void begin(double length_s, TempoMap tempos, bool is_paused);
  // Tells what a MIDI clock or JACK's transport does. Call it often.
  void clock(const Meters& now, const ClockReading& reading);
  State state() const;
  // Waits until this time. Returns false as soon as the state differs from `known`.
  bool wait_until(Clock::time_point time, const State& known);
  void wait(const State& known);     // Waits until the state differs.
  void go_back(const State& known);  // Continues at the start of the loop, without a gap.
  void end(const State& known);      // The last message has been played.
  void wake();                       // Ends all waiting.

 private:
  void begin_change();  // The caller holds the lock.
  Result<Done> change(bool is_jump, const std::function<void(State&)>& what);

  mutable std::mutex mutex_;  // guards all below
  std::condition_variable wake_;
  State state_;
  double length_s_ = -1.0;  // negative: no song
  TempoMap tempos_;
  bool follows_clock_ = false;
  bool is_led_ = false;                       // the clock has started it
  std::optional<std::uint64_t> known_jumps_;  // of the clock
  bool is_over_ = false;
};

}  // namespace ressort::session
