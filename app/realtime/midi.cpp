#include "app/realtime/midi.h"

#include <cmath>
#include <functional>
#include <numeric>

#include "app/realtime/song_clock.h"

namespace ressort::realtime {
namespace {

// Returns the number of data bytes after a status byte; 0 for ignored messages.
int data_bytes(std::uint8_t status) {
  switch (status & 0xf0) {
    case 0xc0:
    case 0xd0:
      return 1;
    case 0xf0:
      return status == 0xf1 || status == 0xf3 ? 1 : status == 0xf2 ? 2 : 0;
    default:
      return 2;
  }
}

Event clock_event(ClockMessage message, double value = 0.0) {
  return {.kind = EventKind::clock, .index = static_cast<std::uint16_t>(message), .value = value};
}

}  // namespace

bool MidiReader::take(std::uint8_t byte, Event& event) {
  if (byte >= 0xf8) {  // a real-time message, which may interrupt any other
    using enum ClockMessage;
    event = clock_event(byte == 0xfa ? start : byte == 0xfb ? resume : byte == 0xfc ? stop : tick);
    return byte == 0xf8 || (byte >= 0xfa && byte <= 0xfc);
  }
  if (byte >= 0x80) {
    if (in_exclusive_ && byte == 0xf7) {
      end_exclusive();
    }
    exclusive_size_ = 0;
    malformed_ += is_begun_ ? 1 : 0;
    in_exclusive_ = byte == 0xf0;
    // 0xf4 and 0xf5 are undefined; 0xf7 ends a system exclusive message.
    malformed_ += byte == 0xf4 || byte == 0xf5 ? 1 : 0;
    status_ = byte;
    need_ = data_bytes(byte);
    have_ = 0;
    is_begun_ = need_ > 0;
    return false;
  }
  if (in_exclusive_) {
    if (exclusive_size_ < exclusive_.size()) {
      exclusive_[exclusive_size_] = byte;
    }
    ++exclusive_size_;
    return false;
  }
  if (status_ == 0 || need_ == 0) {
    ++malformed_;  // a data byte without a status byte before it
    return false;
  }
  data_[have_++] = byte;
  is_begun_ = have_ < need_;
  if (is_begun_) {
    return false;
  }
  have_ = 0;
  return finish(event);
}

bool MidiReader::finish(Event& event) {
  event = Event{};
  event.channel = status_ & 0x0f;
  event.index = data_[0];
  event.value = data_[1] / 127.0;
  switch (status_ & 0xf0) {
    case 0x90:
      event.kind = data_[1] > 0 ? EventKind::note_on : EventKind::note_off;
      event.value = data_[1] > 0 ? event.value : usual_release_velocity;
      return true;
    case 0x80:
      event.kind = EventKind::note_off;
      event.value = release_velocity(event.channel, data_[1]);
      return true;
    case 0xa0:
      event.kind = EventKind::key_pressure;
      return true;
    case 0xb0:
      event.kind = EventKind::controller;
      return true;
    case 0xc0:
      event.kind = EventKind::program;
      event.value = 0.0;
      return true;
    case 0xd0:
      event.kind = EventKind::pressure;
      event.index = 0;
      event.value = data_[0] / 127.0;
      return true;
    case 0xe0: {
      const int bend = (data_[1] << 7 | data_[0]) - 8192;
      event.kind = EventKind::bend;
      event.index = 0;
      event.value = bend < 0 ? bend / 8192.0 : bend / 8191.0;
      return true;
    }
    case 0xf0: {
      const bool is_position = status_ == 0xf2;
      event = clock_event(ClockMessage::song_position, data_[1] << 7 | data_[0]);
      status_ = 0;  // system common has no running status
      return is_position;
    }
    default:
      return false;
  }
}

// Keyboards without a release sensor send 0 or 64 in every note off. So 0 is a speed only if the
// channel has sent other speeds too.
double MidiReader::release_velocity(std::uint8_t channel, std::uint8_t byte) {
  constexpr std::uint8_t usual = 64;
  const auto bit = static_cast<std::uint16_t>(1U << channel);
  if (byte != 0 && byte != usual) {
    has_release_speed_ |= bit;
  }
  return byte == 0 && (has_release_speed_ & bit) == 0 ? usual_release_velocity : byte / 127.0;
}

// Reads a message of the MIDI Tuning Standard. Any device and tuning number is accepted, and the
// channels of an octave tuning are ignored, because there is only one tuning.
//   7f device 08 02 program count (key semitone fraction fraction)...     sounding notes too
//   7e device 08 01 program name[16] (semitone fraction fraction)[128] checksum
//   08 07 (also 7e: new notes only) and 08 04: the same with a bank before the program
//   7f device 08 08 channels[3] cents[12], or 08 09 with 14 bits each     sounding notes too;
//   7e: new notes only
void MidiReader::end_exclusive() {
  const auto& bytes = exclusive_;
  const std::size_t size = exclusive_size_;
  const auto begins = [&](std::uint8_t kind, std::uint8_t what) {
    return size >= 6 && bytes[0] == kind && bytes[2] == 0x08 && bytes[3] == what;
  };
  const bool has_bank = bytes[3] == 0x07 || bytes[3] == 0x04;
  const bool is_change = begins(0x7f, 0x02) || begins(0x7f, 0x07) || begins(0x7e, 0x07);
  is_dump_ = begins(0x7e, 0x01) || begins(0x7e, 0x04);
  retunes_ = bytes[0] == 0x7f;
  const std::size_t bank = has_bank ? 1 : 0;
  const std::size_t change_head = 6 + bank;
  dump_head_ = 21 + bank;  // bytes before the keys
  const std::size_t dump_size = dump_head_ + std::size_t{3} * 128 + 1;
  constexpr std::size_t octave_head = 7;
  const bool is_octave = size >= octave_head && (bytes[0] == 0x7e || bytes[0] == 0x7f) &&
                         bytes[2] == 0x08 && (bytes[3] == 0x08 || bytes[3] == 0x09);
  octave_bytes_ = is_octave ? bytes[3] - 7 : 0;
  bool is_right = size <= longest_exclusive;
  if (is_change) {
    is_right = is_right && size == change_head + std::size_t{4} * bytes[change_head - 1];
    tuned_next_ = change_head;
    tuned_end_ = size;
  } else if (is_dump_) {
    // XOR of all bytes before it, as the standard says.
    const auto sum = [&] {
      return std::accumulate(bytes.begin(),
                             bytes.begin() + static_cast<std::ptrdiff_t>(dump_size) - 1,
                             std::uint8_t{0}, std::bit_xor<>());
    };
    is_right = is_right && size == dump_size && (sum() & 0x7f) == bytes[dump_size - 1];
    tuned_next_ = dump_head_;
    tuned_end_ = dump_size - 1;
  } else if (is_octave) {
    is_right = size == octave_head + 12 * static_cast<std::size_t>(octave_bytes_);
    tuned_next_ = 0;  // keys
    tuned_end_ = 128;
  }
  const bool is_tuning = is_change || is_dump_ || is_octave;
  if (!is_tuning || !is_right) {
    malformed_ += is_tuning && !is_right ? 1 : 0;
    tuned_next_ = tuned_end_ = 0;
  }
}

// A key is a semitone of equal temperament and a 14-bit fraction; all ones mean no change.
bool MidiReader::next_tuned_key(Event& event) {
  if (octave_bytes_ > 0) {
    return next_key_of_octave(event);
  }
  while (tuned_next_ < tuned_end_) {
    const std::size_t row = is_dump_ ? (tuned_next_ - dump_head_) / 3 : 0;
    const auto key = static_cast<std::uint16_t>(is_dump_ ? row : exclusive_[tuned_next_++]);
    const int semitone = exclusive_[tuned_next_];
    const int fraction = exclusive_[tuned_next_ + 1] << 7 | exclusive_[tuned_next_ + 2];
    tuned_next_ += 3;
    if (semitone == 0x7f && fraction == 0x3fff) {
      continue;
    }
    event = {.kind = EventKind::key_tuning,
             .index = key,
             .value = 440.0 * std::exp2((semitone - 69 + fraction / 16384.0) / 12.0),
             .value2 = retunes_ ? 1.0 : 0.0};
    return true;
  }
  return false;
}

// Cents from equal temperament for C to B: one byte with 64 as zero, or 14 bits for -100 to 100.
bool MidiReader::next_key_of_octave(Event& event) {
  if (tuned_next_ >= tuned_end_) {
    return false;
  }
  const auto key = static_cast<int>(tuned_next_++);
  const std::uint8_t* const row =
      &exclusive_[7 + static_cast<std::size_t>(key % 12 * octave_bytes_)];
  const double cents =
      octave_bytes_ == 1 ? row[0] - 64 : 100.0 * ((row[0] << 7 | row[1]) - 8192) / 8192.0;
  event = {.kind = EventKind::key_tuning,
           .index = static_cast<std::uint16_t>(key),
           .value = 440.0 * std::exp2((key - 69 + cents / 100.0) / 12.0),
           .value2 = retunes_ ? 1.0 : 0.0};
  return true;
}

void MidiReader::end_packet() {
  malformed_ += is_begun_ ? 1 : 0;
  is_begun_ = false;
  have_ = 0;
}

}  // namespace ressort::realtime
