// core/engine: what lies between two cuts of a block: nothing happens within it, and all voices can
// be computed in one go.
#pragma once

#include <cstddef>
#include <span>

namespace ressort {

// Frames [at, at + frames) of a block's channels.
struct Segment {
  std::span<const double* const> inputs;  // null where there is none
  std::span<double* const> outputs;
  std::size_t at = 0;
  std::size_t frames = 0;
  std::size_t end() const { return at + frames; }
};

}  // namespace ressort
