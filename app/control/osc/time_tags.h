// app/control: from OSC's time tags to frames of the audio.
#pragma once

#include <cstdint>

#include "app/realtime/lockfree.h"

namespace ressort::control {

inline constexpr double tag_horizon_s = 10.0;  // farther ahead nothing is kept

// Seconds from one tag to another; tags wrap around in 2036.
double seconds_between(std::uint64_t from, std::uint64_t to);

// From time tags to frames. Every block's clock reading jitters a little, so that a passage is
// counted from one anchor: equal distances of tags are equal distances of frames, whatever the
// readings between them say. The anchor is a whole frame at its own tag, so that tags that are
// whole frames apart never come near the edge where rounding decides. It is given up when it is
// 10 ms wrong, because the sound card's clock drifts or has stood still, and after a pause.
class TagClock {
 public:
  TagClock();

  // Looks whether the wall clock was set. [control]
  void follow_wall_clock();

  // The tag of the newest block's first frame.
  std::uint64_t now(const ClockReading& clock) const;

  // The frame of a tag; of one beyond the horizon only roughly. [control]
  std::int64_t frame(std::uint64_t tag, const ClockReading& clock);

 private:
  std::int64_t offset_ns_ = 0;  // of the wall clock before the monotonic one
  std::uint64_t tag_ = 0;       // the anchor: this tag is this frame at this rate
  std::int64_t frame_ = 0;
  double rate_hz_ = 0.0;  // 0: no anchor
  std::uint64_t used_ = 0;
};

}  // namespace ressort::control
