// app/realtime: MIDI bytes to events. Pure: no thread, no device, no heap.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "app/rooms.h"
#include "core/engine/event.h"

namespace ressort::realtime {

// Turns packets of MIDI bytes into events. Knows running status, several messages in a packet,
// real-time bytes in between and, of system exclusive, the tunings of the MIDI Tuning Standard,
// whole or in pieces; all else there is passed over. A message that is cut short or unknown is
// counted and makes no event.
class MidiReader {
 public:
  // Calls `emit(Event)` for each message, and for each key of a tuning; frames are the caller's to
  // set. [the packets' thread] wait-free if `emit` is
  template <class Emit>
  void read(std::span<const std::uint8_t> bytes, Emit&& emit) {
    Event event;
    for (const std::uint8_t byte : bytes) {
      if (take(byte, event)) {
        emit(event);
      }
      while (next_tuned_key(event)) {
        emit(event);
      }
    }
    end_packet();
  }

  std::uint64_t malformed() const { return malformed_; }

 private:
  bool take(std::uint8_t byte, Event& event);
  bool finish(Event& event);
  void end_exclusive();
  bool next_tuned_key(Event& event);
  bool next_key_of_octave(Event& event);
  void end_packet();

  std::uint8_t status_ = 0;  // of the message being read; kept for running status
  std::uint8_t data_[2] = {0, 0};
  int have_ = 0;
  int need_ = 0;
  bool is_begun_ = false;  // a message that is not yet complete
  bool in_exclusive_ = false;
  // Between its first byte and its last: no tuning is longer. Of what is, the rest is left out.
  static constexpr std::size_t longest_exclusive = 518;
  std::array<std::uint8_t, longest_exclusive> exclusive_{};
  std::size_t exclusive_size_ = 0;
  std::size_t tuned_next_ = 0;  // where the next key of a whole tuning stands in it,
  std::size_t tuned_end_ = 0;   // and where they end
  bool is_dump_ = false;        // all keys from 0 on, for the notes that come
  int octave_bytes_ = 0;        // of each of the twelve keys of an octave; 0: it is no such tuning
  std::uint64_t malformed_ = 0;
};

}  // namespace ressort::realtime
