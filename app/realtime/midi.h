// app/realtime: MIDI bytes to events. Pure: no thread, no device, no heap.
#pragma once

#include <cstdint>
#include <span>

#include "core/engine/event.h"

namespace ressort {

// Turns packets of MIDI bytes into events. Knows running status, several messages in a packet,
// real-time bytes in between and system exclusive to pass over; a message that is cut short or
// unknown is counted and makes no event.
class MidiReader {
 public:
  // Calls `emit(Event)` for each message; frames are the caller's to set. [the packets' thread]
  // wait-free if `emit` is
  template <class Emit>
  void read(std::span<const std::uint8_t> bytes, Emit&& emit) {
    Event event;
    for (const std::uint8_t byte : bytes) {
      if (take(byte, event)) {
        emit(event);
      }
    }
    end_packet();
  }

  std::uint64_t malformed() const { return malformed_; }

 private:
  bool take(std::uint8_t byte, Event& event);
  bool finish(Event& event);
  void end_packet();

  std::uint8_t status_ = 0;  // of the message being read; kept for running status
  std::uint8_t data_[2] = {0, 0};
  int have_ = 0;
  int need_ = 0;
  bool is_begun_ = false;  // a message that is not yet complete
  bool in_exclusive_ = false;
  std::uint64_t malformed_ = 0;
};

}  // namespace ressort
