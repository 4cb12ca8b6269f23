// core/engine/midi: the keys that are down on one channel, in the order in which they went down: of
// them one voice alone plays the last.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "core/rooms.h"

namespace ressort::engine {

struct HeldKey {
  std::uint8_t key = 0;
  double velocity = 0.0;
  double frequency_hz = 0.0;  // 0: the key's own
};

// All functions: [audio] wait-free, O(keys).
class HeldKeys {
 public:
  void press(int key, double velocity, double frequency_hz = 0.0) {
    lift(key);
    keys_[count_++] = {static_cast<std::uint8_t>(key), velocity, frequency_hz};
  }
  void lift(int key) {
    const auto end = keys_.begin() + static_cast<std::ptrdiff_t>(count_);
    count_ = static_cast<std::size_t>(
        std::remove_if(keys_.begin(), end, [&](const HeldKey& held) { return held.key == key; }) -
        keys_.begin());
  }
  void clear() { count_ = 0; }
  bool is_empty() const { return count_ == 0; }
  std::optional<HeldKey> last() const {
    return count_ > 0 ? std::optional(keys_[count_ - 1]) : std::nullopt;
  }

 private:
  std::array<HeldKey, 128> keys_{};
  std::size_t count_ = 0;
};

}  // namespace ressort::engine
