// tests: a preset's engine as `render` makes it, without the limiter, played note by note.
#pragma once

#include <memory>
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

class Player {
 public:
  // Throws std::runtime_error with all that is wrong.
  Player(const std::string& name, double rate_hz);

  // From silence, parameters as the preset has them; events sorted by time. Nothing comes in.
  Stereo play(const std::vector<TimedEvent>& events, double seconds);
  Stereo go_on(double seconds);            // with what sounds
  double real_time_share(double seconds);  // of a core, by all voices, one note each

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
