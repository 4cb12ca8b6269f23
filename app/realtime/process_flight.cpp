// Process: writing the flight log and reproducing a flight.
#include <algorithm>
#include <utility>

#include "app/realtime/process.h"

namespace ressort::realtime {

void Process::keep(const FlightRecord& record) {
  if (!keeps_flight.is_raised()) {
    return;
  }
  if (has_gap_) {
    has_gap_ = !flight.push({.frame = record.frame, .kind = FlightRecord::Kind::gap});
  }
  has_gap_ = has_gap_ || !flight.push(record);
}

void Process::keep_period(std::size_t frames, std::size_t channels) {
  if (!keeps_flight.is_raised()) {
    return;
  }
  if (std::exchange(kept_rate_hz_, rate_hz_) != rate_hz_) {
    keep({.frame = frame_, .kind = FlightRecord::Kind::rate, .event = {.value = rate_hz_}});
  }
  const bool is_other_period = std::exchange(kept_frames_, frames) != frames;
  const bool has_other_channels = std::exchange(kept_channels_, channels) != channels;
  if (is_other_period || has_other_channels) {
    keep({.frame = frame_,
          .kind = FlightRecord::Kind::period,
          .count = static_cast<std::uint32_t>(frames),
          .channels = static_cast<std::uint32_t>(channels)});
  }
}

// Takes the next engine, if there is one.
Sounding* Process::take() {
  Sounding* const next = slot.take();
  if (next != nullptr) {
    keep({.frame = frame_, .kind = FlightRecord::Kind::take, .count = next->number});
  }
  return next;
}

void Process::play(const SampleTape& tape, std::size_t output_count, std::size_t frames) {
  for (std::size_t n = 0; n < frames; ++n, ++tape_at_) {
    const bool is_over = tape_at_ >= tape.frames();
    for (std::size_t c = 0; c < output_count; ++c) {
      mixed_[c * chunk_frames + n] =
          is_over || c >= tape.channels
              ? 0.0
              : static_cast<double>(tape.samples[tape_at_ * tape.channels + c]);
    }
  }
  if (tape_at_ >= tape.frames()) {
    is_tape_over.raise();
  }
}

void Process::repeat(const FlightRecord& record) {
  is_repeating_ = true;
  keeps_every_frame_ = true;
  switch (record.kind) {
    case FlightRecord::Kind::event:
      return wait(record.frame, record.event);
    case FlightRecord::Kind::rate:
      return set_rate(record.event.value);
    case FlightRecord::Kind::limit:
      return current_ != nullptr ? current_->engine->limit_voices(static_cast<int>(record.count))
                                 : void();
    case FlightRecord::Kind::hurry:
      return fading_ != nullptr ? hurry() : void();
    case FlightRecord::Kind::period:
    case FlightRecord::Kind::take:
    case FlightRecord::Kind::gap:
      return;  // the caller of block() handles these
  }
}

}  // namespace ressort::realtime
