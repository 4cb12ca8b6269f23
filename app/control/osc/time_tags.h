// app/control: converts OSC time tags to audio frames.
#pragma once

#include <cstdint>

#include "app/realtime/lockfree.h"

namespace ressort::control {

inline constexpr double tag_horizon_s = 10.0;  // Events farther ahead are rejected.

// Returns the seconds between two tags; tags wrap around in 2036.
double seconds_between(std::uint64_t from, std::uint64_t to);

// Converts time tags to frames. The clock reading of each block has jitter, so frames are counted
// from one anchor: equal distances of tags are equal distances of frames, whatever later readings
// say. The anchor is a whole frame at its own tag, so that tags that are whole frames apart stay
// away from the rounding boundary. The anchor is dropped after a pause, and when it is off by 10
// ms, because the sound card's clock drifts or has stopped.
class TagClock {
 public:
  TagClock();

  // Detects changes of the wall clock. [control]
  void follow_wall_clock();

  // Returns the tag of the newest block's first frame.
  std::uint64_t now(const ClockReading& clock) const;

  // Returns the frame of a tag; only roughly beyond the horizon. [control]
  std::int64_t frame(std::uint64_t tag, const ClockReading& clock);

 private:
  std::int64_t offset_ns_ = 0;  // Wall clock minus monotonic clock.
  std::uint64_t tag_ = 0;       // Anchor: this tag is this frame at this rate.
  std::int64_t frame_ = 0;
  double rate_hz_ = 0.0;  // 0: no anchor.
  std::uint64_t used_ = 0;
};

}  // namespace ressort::control
