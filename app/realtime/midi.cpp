#include "app/realtime/midi.h"

namespace ressort {
namespace {

// Data bytes after a status byte; 0 for those that carry none or are passed over.
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

}  // namespace

bool MidiReader::take(std::uint8_t byte, Event& event) {
  if (byte >= 0xf8) {
    return false;  // clock, active sensing, reset: not for us, and no part of any message
  }
  if (byte >= 0x80) {
    malformed_ += is_begun_ ? 1 : 0;
    in_exclusive_ = byte == 0xf0;
    // 0xf4, 0xf5 are not defined; 0xf7 ends an exclusive.
    malformed_ += byte == 0xf4 || byte == 0xf5 ? 1 : 0;
    status_ = byte;
    need_ = data_bytes(byte);
    have_ = 0;
    is_begun_ = need_ > 0;
    return false;
  }
  if (in_exclusive_) {
    return false;
  }
  if (status_ == 0 || need_ == 0) {
    ++malformed_;  // data without a status that wants it
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
      return true;
    case 0xa0:
      event.kind = EventKind::key_pressure;
      return true;
    case 0xb0:
      event.kind = EventKind::controller;
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
    case 0xf0:
      status_ = 0;
      return false;  // system common has no running status
    default:
      return false;  // program change
  }
}

void MidiReader::end_packet() {
  malformed_ += is_begun_ ? 1 : 0;
  is_begun_ = false;
  have_ = 0;
}

}  // namespace ressort
