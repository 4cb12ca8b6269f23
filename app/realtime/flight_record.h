// app/realtime: what moved the engines, in the order in which it did: all that a Process needs to
// play the same samples once more.
#pragma once

#include <cstdint>

#include "app/rooms.h"
#include "core/engine/event.h"

namespace ressort::realtime {

struct FlightRecord {
  enum class Kind : std::uint8_t {
    event,   // acted
    rate,    // what follows is played at `event.value` Hz
    period,  // from here on blocks have `count` frames and `channels` outputs
    take,    // the engine whose number is `count` was taken to be the next
    limit,   // after the block before, `count` voices may sound at once
    hurry,   // the same: what fades goes at once
    gap,     // what was before is not known: nobody read in time
  };
  std::int64_t frame = 0;  // of the process's own count
  Kind kind = Kind::event;
  std::uint32_t count = 0;
  std::uint32_t channels = 0;
  Event event;
};

}  // namespace ressort::realtime
