// app/realtime: parses MIDI bytes into events. No threads, devices or heap memory.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "app/rooms.h"
#include "core/engine/event.h"

namespace ressort::realtime {

// Parses packets of MIDI bytes into events. Handles running status, several messages in a packet,
// real-time bytes inside a message, and the system exclusive messages of the MIDI Tuning Standard,
// whole or split over packets. Ignores all other system exclusive messages. Truncated and unknown
// messages are counted and make no event.
class MidiReader {
 public:
  // Calls `emit(Event)` for each message, and for each key of a tuning message. The caller sets the
  // frame. [the packets' thread] wait-free if `emit` is
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
  double release_velocity(std::uint8_t channel, std::uint8_t byte);
  void end_exclusive();
  bool next_tuned_key(Event& event);
  bool next_key_of_octave(Event& event);
  void end_packet();

  std::uint8_t status_ = 0;  // status byte of the current message; kept for running status
  std::uint8_t data_[2] = {0, 0};
  // A bit for each channel that has sent a release velocity other than 0 and 64.
  std::uint16_t has_release_speed_ = 0;
  int have_ = 0;
  int need_ = 0;
  bool is_begun_ = false;  // a message is incomplete
  bool in_exclusive_ = false;
  // Data bytes of the longest tuning message. Bytes of a longer message are ignored.
  static constexpr std::size_t longest_exclusive = 518;
  std::array<std::uint8_t, longest_exclusive> exclusive_{};
  std::size_t exclusive_size_ = 0;
  std::size_t tuned_next_ = 0;  // position of the next key of a tuning message in `exclusive_`
  std::size_t tuned_end_ = 0;   // end of the keys
  std::size_t dump_head_ = 0;   // bytes before the keys of a bulk dump
  bool is_dump_ = false;        // a bulk dump: all keys from 0
  bool retunes_ = false;        // sounding notes too
  int octave_bytes_ = 0;        // bytes for each key of an octave tuning; 0: another message
  std::uint64_t malformed_ = 0;
};

}  // namespace ressort::realtime
