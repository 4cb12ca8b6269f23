// core/kernels: interpolation at points on macros and bodies. The functions are `static` because
// several loops that are compiled for different instruction sets include them.
#pragma once

#include "core/kernels/program.h"

namespace ressort::kernels {

inline constexpr std::size_t tap_corners = 4;

// The nodes around a point, as indices into Program::tap_nodes, and their weights. For a point on a
// body, the places next to it instead of nodes.
template <class T>
struct Corners {
  std::uint32_t node[tap_corners] = {};
  T weight[tap_corners] = {};
};

// Returns the weights of bilinear interpolation: max(0, 1 - |p - i|) along each side, where p is
// the coordinate in nodes.
template <class T>
static inline Corners<T> corners_at(const TapSlot& slot, T u, T v) {
  const auto split = [](T coordinate, std::uint32_t nodes, std::uint32_t& below) {
    // Unlike std::clamp, this maps NaN to 0.
    const T within = coordinate > 0 ? (coordinate < 1 ? coordinate : T(1)) : T(0);
    const T p = within * static_cast<T>(nodes - 1);
    below = static_cast<std::uint32_t>(p);
    return p - static_cast<T>(below);
  };
  std::uint32_t row = 0;
  std::uint32_t column = 0;
  if (slot.is_on_body()) {
    const T beyond = split(u, slot.places, row);
    return {{row, row + 1}, {1 - beyond, beyond}};
  }
  const T alpha = split(u, slot.length, row);
  const T beta = split(v, slot.width, column);
  const std::uint32_t node = slot.first + row * slot.width + column;
  return {{node, node + 1, node + slot.width, node + slot.width + 1},
          {(1 - alpha) * (1 - beta), (1 - alpha) * beta, alpha * (1 - beta), alpha * beta}};
}

// Calls use(node, weight) for the corners with a weight above 0. The others may not exist.
template <class T, class Use>
static inline void each_corner(const Corners<T>& corners, Use&& use) {
  for (std::size_t i = 0; i < tap_corners; ++i) {
    if (corners.weight[i] > 0) {
      use(corners.node[i], corners.weight[i]);
    }
  }
}

// Returns the displacement of a point on a body per displacement of a mode.
template <class T>
static inline T weight_of_mode(const Program& program, const TapSlot& slot,
                               const Corners<T>& corners, std::uint32_t mode) {
  const double* const near = program.shapes.data() + slot.shape + corners.node[0] * slot.length;
  const double* const far = corners.weight[1] > 0 ? near + slot.length : near;
  return corners.weight[0] * static_cast<T>(near[mode]) +
         corners.weight[1] * static_cast<T>(far[mode]);
}

// Calls use(node, weight) for every node that moves a point.
template <class T, class Use>
static inline void each_behind(const Program& program, const TapSlot& slot,
                               const Corners<T>& corners, Use&& use) {
  if (!slot.is_on_body()) {
    return each_corner(corners,
                       [&](std::uint32_t at, T weight) { use(program.tap_nodes[at], weight); });
  }
  for (std::uint32_t mode = 0; mode < slot.length; ++mode) {
    use(program.tap_nodes[slot.first + mode], weight_of_mode(program, slot, corners, mode));
  }
}

// Returns whether a Program has points on bodies, which only some kernels support.
static inline bool has_bodies(const Program& program) {
  for (const TapSlot& slot : program.taps) {
    if (slot.is_on_body()) {
      return true;
    }
  }
  return false;
}

}  // namespace ressort::kernels
