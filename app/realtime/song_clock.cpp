#include "app/realtime/song_clock.h"

#include <cmath>

namespace ressort::realtime {

constexpr double ticks_per_beat = 24.0;
constexpr std::int64_t ticks_per_sixteenth = 6;

bool SongClock::follow(const Event& message, std::int64_t frame) {
  const bool rolls = leads_by_midi_ && place_.rolls;
  switch (ClockMessage{message.index}) {
    case ClockMessage::tick:
      if (waits_for_tick_) {
        jump(true, frame);
      } else if (rolls) {
        ++ticks_;
        place_.position = static_cast<double>(ticks_) / ticks_per_beat;
        place_.frame = frame;
      }
      return true;
    case ClockMessage::start:
      ticks_ = 0;
      waits_for_tick_ = true;
      break;
    case ClockMessage::resume:
      waits_for_tick_ = true;
      break;
    case ClockMessage::stop:
      jump(false, frame);
      break;
    case ClockMessage::song_position:
      ticks_ = ticks_per_sixteenth * std::llround(message.value);
      waits_for_tick_ = rolls || waits_for_tick_;
      if (!waits_for_tick_) {
        jump(false, frame);
      }
      break;
  }
  return false;
}

void SongClock::jump(bool rolls, std::int64_t frame) {
  leads_by_midi_ = true;
  waits_for_tick_ = false;
  place_ = {rolls, true, static_cast<double>(ticks_) / ticks_per_beat, frame, place_.jumps + 1};
}

void SongClock::follow(const Transport& now, std::int64_t frame, double block_s) {
  constexpr double least_jump = 0.05;  // beats or seconds; smaller ones are rounding
  const bool jumps =
      now.rolls != transport_.rolls ||
      (now.in_beats == transport_.in_beats ? std::fabs(now.position - expected_) > least_jump
                                           : now.rolls);
  transport_ = now;
  expected_ = now.position + (now.rolls ? block_s * (now.in_beats ? now.beats_per_s : 1.0) : 0.0);
  leads_by_midi_ = leads_by_midi_ && !jumps;
  if (jumps || (now.rolls && !leads_by_midi_)) {
    place_ = {now.rolls, now.in_beats, now.position, frame, place_.jumps + (jumps ? 1 : 0)};
  }
}

}  // namespace ressort::realtime
