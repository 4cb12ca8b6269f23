// core/engine/midi: distributes notes over several engines that play one instrument together. All
// engines receive the same events from the start, so each computes the same distribution.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/engine/midi/channels.h"

namespace ressort::engine {

// All functions: [audio] wait-free.
class NoteShare {
 public:
  static constexpr int most_parts = 64;
  struct Part {
    int number = 1;  // number of this engine, from 1
    int of = 1;      // number of engines
  };

  explicit NoteShare(Part part) : part_(part) {}
  void adopt(const NoteShare& from) {
    owners_ = from.owners_;
    next_ = from.next_;
  }

  // Returns whether this engine plays a pressed key. New keys go to the engines in turn. A repeated
  // key stays with its engine, where its last note may still ring.
  bool owns(std::uint8_t channel, std::size_t key) {
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
  // The first engine plays everything that uses one voice only.
  bool is_first() const { return part_.number == 1; }
  // Forgets all keys. The next key goes to the first engine.
  void restart() {
    owners_ = {};
    next_ = 0;
  }

 private:
  Part part_;
  std::array<std::array<std::uint8_t, 128>, Channels::count>
      owners_{};  // [channel][key] engine from 1; 0: none
  int next_ = 0;
};

}  // namespace ressort::engine
