// core/engine/midi: which notes are an engine's own, where several play the voices of one
// instrument in turn. All of them hear the same notes from the beginning, so that each knows what
// the others take.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/engine/midi/channels.h"

namespace ressort::engine {

// One of so many. All functions: [audio] wait-free.
class NoteShare {
 public:
  static constexpr int most_parts = 64;
  struct Part {
    int number = 1;  // from 1
    int of = 1;
  };

  explicit NoteShare(Part part) : part_(part) {}
  void adopt(const NoteShare& from) {
    owners_ = from.owners_;
    next_ = from.next_;
  }

  // A key goes down: whether its note is this engine's. The engines take new keys in turn. One that
  // has been played before stays where it was, as its last note may ring there.
  bool takes(std::uint8_t channel, std::size_t key) {
    if (part_.of == 1) {
      return true;
    }
    std::uint8_t& owner = owners_[channel % Channels::count][key % 128];
    if (owner == 0) {
      owner = static_cast<std::uint8_t>(next_ + 1);
      next_ = (next_ + 1) % part_.of;
    }
    return owner == part_.number;
  }
  // What is one voice only is the first engine's.
  bool is_first() const { return part_.number == 1; }
  // Nothing rings any more: the next key is the first engine's.
  void begin_anew() {
    owners_ = {};
    next_ = 0;
  }

 private:
  Part part_;
  std::array<std::array<std::uint8_t, 128>, Channels::count> owners_{};  // [channel][key] or 0
  int next_ = 0;
};

}  // namespace ressort::engine
