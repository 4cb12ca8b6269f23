// core/engine: small differences from note to note, as a player makes them: of strength and of
// time. The same notes have the same differences in every render.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "core/engine/event.h"
#include "core/engine/playing.h"
#include "core/noise.h"

namespace ressort::engine {

// All functions but the constructor: [audio] wait-free, O(events that wait).
class NoteVariation {
 public:
  NoteVariation(const Variation& variation, double rate_hz)
      : strength_(variation.strength), most_frames_(variation.timing_s * rate_hz) {}
  void continue_from(const NoteVariation& from) {
    strengths_ = from.strengths_;
    times_ = from.times_;
    waiting_ = from.waiting_;
    count_ = from.count_;
  }

  double varied(double strength) {
    return strength_ == 0.0
               ? strength
               : std::clamp(strength * (1.0 + strength_ * strengths_.next()), 0.0, 1.0);
  }
  // Delays a note-on. A later event of the same key waits for it, so that no key stays down.
  // Returns false if the event does not wait.
  bool delay(const Event& event) {
    const bool is_on = event.kind == EventKind::note_on;
    if (most_frames_ == 0.0 || (!is_on && event.kind != EventKind::note_off)) {
      return false;
    }
    std::size_t frames =
        is_on ? static_cast<std::size_t>(std::lround(most_frames_ * (0.5 + 0.5 * times_.next())))
              : 0;
    for (std::size_t i = 0; i < count_; ++i) {
      const Event& before = waiting_[i].event;
      if (before.channel == event.channel && before.index == event.index) {
        frames = std::max(frames, waiting_[i].frames);
      }
    }
    if (frames == 0 || count_ == waiting_.size()) {
      return false;
    }
    waiting_[count_++] = {event, frames};
    return true;
  }
  // Drops the events of some channels that wait.
  void drop(ChannelMask channels) {
    keep_if([&](const Waiting& one) { return !has_channel(channels, one.event.channel); });
  }
  // Returns the frames until the next event is due, at most `most`.
  std::size_t frames_left(std::size_t most) const {
    for (std::size_t i = 0; i < count_; ++i) {
      most = std::min(most, waiting_[i].frames);
    }
    return most;
  }
  void advance(std::size_t frames) {
    for (std::size_t i = 0; i < count_; ++i) {
      waiting_[i].frames -= std::min(frames, waiting_[i].frames);
    }
  }
  // Returns an event that is due, in the order in which they came.
  std::optional<Event> take_due() {
    for (std::size_t i = 0; i < count_; ++i) {
      if (waiting_[i].frames == 0) {
        const Event due = waiting_[i].event;
        std::copy(waiting_.begin() + static_cast<std::ptrdiff_t>(i) + 1,
                  waiting_.begin() + static_cast<std::ptrdiff_t>(count_),
                  waiting_.begin() + static_cast<std::ptrdiff_t>(i));
        --count_;
        return due;
      }
    }
    return std::nullopt;
  }

 private:
  struct Waiting {
    Event event;
    std::size_t frames = 0;
  };
  template <class Keep>
  void keep_if(Keep&& keep) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < count_; ++i) {
      if (keep(waiting_[i])) {
        waiting_[kept++] = waiting_[i];
      }
    }
    count_ = kept;
  }

  double strength_;
  double most_frames_;
  RandomNumbers strengths_{1};
  RandomNumbers times_{2};
  std::array<Waiting, 128> waiting_{};
  std::size_t count_ = 0;
};

}  // namespace ressort::engine
