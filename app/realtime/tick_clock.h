// app/realtime: estimates the tempo of a MIDI clock.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "app/rooms.h"

namespace ressort::realtime {

// The mean of the last beat, so that jitter of the ticks changes the tempo little: by 0.3 % for a
// period of 64 frames at 120 beats per minute and 48 kHz.
class TickClock {
 public:
  // Adds a tick. Returns beats per second, or 0 in the first quarter of a beat. [audio] wait-free
  double add(std::int64_t frame, double rate_hz) {
    if (count_ > 0 && static_cast<double>(frame - at(count_ - 1)) > longest_s * rate_hz) {
      count_ = 0;
    }
    frames_[count_ % frames_.size()] = frame;
    const std::uint64_t ticks = std::min(count_, ticks_per_beat);
    const std::int64_t first = at(count_ - ticks);
    ++count_;
    return ticks < least_ticks || frame <= first
               ? 0.0
               : static_cast<double>(ticks) * rate_hz /
                     static_cast<double>(ticks_per_beat *
                                         static_cast<std::uint64_t>(frame - first));
  }

 private:
  static constexpr std::uint64_t ticks_per_beat = 24;
  static constexpr std::uint64_t least_ticks = 6;
  static constexpr double longest_s =
      0.25;  // between two ticks; after a longer pause it starts anew

  std::int64_t at(std::uint64_t tick) const { return frames_[tick % frames_.size()]; }

  std::array<std::int64_t, ticks_per_beat + 1> frames_{};
  std::uint64_t count_ = 0;  // ticks since the start or the last pause
};

}  // namespace ressort::realtime
