// core/kernels: where points on macros are. Their kernels' loops share this; `static`, since these
// are compiled for each instruction set.
#pragma once

#include "core/kernels/program.h"

namespace ressort {

inline constexpr std::size_t tap_corners = 4;

// The nodes around a point, of Program::tap_nodes, and their weights.
template <class T>
struct Corners {
  std::uint32_t node[tap_corners] = {};
  T weight[tap_corners] = {};
};

// w_i = max(0, 1 - |p - i|) along each side, p being the coordinate in nodes.
template <class T>
static inline Corners<T> corners_at(const TapSlot& slot, T u, T v) {
  const auto split = [](T coordinate, std::uint32_t nodes, std::uint32_t& below) {
    // Not std::clamp: what is no number becomes 0.
    const T within = coordinate > 0 ? (coordinate < 1 ? coordinate : T(1)) : T(0);
    const T p = within * static_cast<T>(nodes - 1);
    below = static_cast<std::uint32_t>(p);
    return p - static_cast<T>(below);
  };
  std::uint32_t row = 0;
  std::uint32_t column = 0;
  const T alpha = split(u, slot.length, row);
  const T beta = split(v, slot.width, column);
  const std::uint32_t node = slot.first + row * slot.width + column;
  return {{node, node + 1, node + slot.width, node + slot.width + 1},
          {(1 - alpha) * (1 - beta), (1 - alpha) * beta, alpha * (1 - beta), alpha * beta}};
}

// Calls use(node, weight) for those that weigh anything; the others may not exist.
template <class T, class Use>
static inline void each_corner(const Corners<T>& corners, Use&& use) {
  for (std::size_t i = 0; i < tap_corners; ++i) {
    if (corners.weight[i] > 0) {
      use(corners.node[i], corners.weight[i]);
    }
  }
}

}  // namespace ressort
