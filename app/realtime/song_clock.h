// app/realtime: follows a MIDI clock and JACK's transport.
#pragma once

#include <cstdint>

#include "app/rooms.h"
#include "core/engine/event.h"

namespace ressort::realtime {

// Event::index of an EventKind::clock. A song position has sixteenth notes in Event::value.
enum class ClockMessage : std::uint16_t { tick, start, resume, stop, song_position };

// JACK's transport at the first frame of a block.
struct Transport {
  double beats_per_s = 0.0;  // 0: it has no tempo
  bool rolls = false;
  bool in_beats = false;  // unit of `position`: beats, else seconds
  double position = 0.0;  // from the start of the song
};

// A place in the song, as the clock or the transport that leads has it.
struct SongPlace {
  bool rolls = false;
  bool in_beats = false;
  double position = 0.0;
  std::int64_t frame = 0;   // frame of the process at this place
  std::uint64_t jumps = 0;  // starts, stops and jumps so far
};

// The clock or the transport leads, whichever has started, stopped or jumped last. All functions:
// [audio] wait-free
class SongClock {
 public:
  // Returns whether the message is a tick.
  bool follow(const Event& message, std::int64_t frame);
  void follow(const Transport& now, std::int64_t frame, double block_s);
  const SongPlace& place() const { return place_; }

 private:
  void jump(bool rolls, std::int64_t frame);

  SongPlace place_;
  bool leads_by_midi_ = false;
  bool waits_for_tick_ = false;  // starts at the next tick
  std::int64_t ticks_ = 0;       // of the MIDI clock, from the start of the song
  Transport transport_;          // in the block before
  double expected_ = 0.0;        // position of the transport, if it does not jump
};

}  // namespace ressort::realtime
