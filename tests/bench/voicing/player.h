// tests: plays a preset's engine note by note, as `render` makes it but without the limiter.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "app/session/loader.h"
#include "core/compile/compile.h"
#include "core/engine/dc_blocker.h"
#include "tests/bench/voicing/sound.h"
#include "tests/support/rooms.h"

namespace ressort::voicing {

struct TimedEvent {
  double time_s = 0.0;
  Event event;
};

Event note_on(int key, int velocity);  // 0..127
Event note_off(int key);
Event turn(int controller, double amount);
Event press(double amount);  // the whole channel

// Returns a note of forte for each voice, on a key of its own from `lowest` on, `step` semitones
// apart. Beyond 64 notes the keys begin again on the next channel.
std::vector<TimedEvent> chord(int voices, int lowest, int step);
// Returns such a chord from C3 up in whole tones, or with more than 16 voices from E1 in semitones.
std::vector<TimedEvent> chord(int voices);

class Player {
 public:
  // Throws std::runtime_error with all errors. Without LFOs, a bow plays without vibrato. Without a
  // precision it is the preset's.
  Player(const std::string& name, double rate_hz, bool with_lfos = true,
         std::optional<Precision> precision = {});

  // Plays from silence, with the parameters of the preset and without input signals. The events are
  // sorted by time.
  Stereo play(const std::vector<TimedEvent>& events, double seconds);
  Stereo continue_playing(double seconds);  // Continues with the voices that sound.
  // Returns the processor time of these events, played from silence, as a share of one core.
  double processor_share(const std::vector<TimedEvent>& events, double seconds);
  // Returns the least such share of a number of voices, each with a note, and the bodies in the
  // first seconds of these notes.
  double real_time_share(double seconds, int voices);

  // Returns the share that the plan predicts for all voices, with all contacts closed.
  double predicted_share() const;

  const Scene& scene() const { return scene_; }
  const Instrument& instrument() const { return compiled_.instrument; }

 private:
  void run(const std::vector<TimedEvent>& events, double seconds, Stereo* sound);
  void reset();

  Scene scene_;
  Compiled compiled_;
  double rate_hz_;
  DcBlocker blocker_;
};

}  // namespace ressort::voicing
