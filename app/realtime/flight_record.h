// app/realtime: a log of everything that changed the engines, in order. A Process can reproduce the
// same samples from it.
#pragma once

#include <cstdint>

#include "app/rooms.h"
#include "core/engine/event.h"

namespace ressort::realtime {

struct FlightRecord {
  enum class Kind : std::uint8_t {
    event,   // an event acted
    rate,    // the sample rate is `event.value` Hz from here on
    period,  // blocks have `count` frames and `channels` outputs from here on
    take,    // the engine with the number `count` became the next one
    limit,   // after this block, at most `count` voices sound
    hurry,   // after this block, the fading engine ends at once
    gap,     // records before this one were lost: the reader was too slow
  };
  std::int64_t frame = 0;  // frame of the process's own count
  Kind kind = Kind::event;
  std::uint32_t count = 0;
  std::uint32_t channels = 0;
  Event event;
};

}  // namespace ressort::realtime
