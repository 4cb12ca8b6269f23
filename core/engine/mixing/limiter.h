// core/engine: the last guard before a loudspeaker.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "core/rooms.h"

namespace ressort::engine {

// A look-ahead limiter: the output never passes `ceiling`, is never non-finite, and is the input,
// bit for bit and 1 ms later, as long as that stays below. All channels share one gain, so the
// stereo picture stands still. Heap-free after construction.
class Limiter {
 public:
  static constexpr std::size_t lookahead_frames = 48;
  static constexpr std::size_t max_channels = 64;
  static constexpr double ceiling = 0.999;  // just below full scale of every sample format

  explicit Limiter(double rate_hz);

  // In place. [audio] wait-free, O(frames * (channels + lookahead_frames)) at worst
  void process(std::span<double* const> channels, std::size_t frames);

  // The deepest gain reduction since the last call, as a factor 0..1. [audio]
  double take_reduction();

 private:
  void delay(std::span<double* const> channels, std::size_t frames);
  void limit(std::span<double* const> channels, std::size_t frames);

  std::array<std::array<double, lookahead_frames>, max_channels> delayed_{};
  std::array<double, lookahead_frames> wanted_{};    // gain that each sample in flight needs
  std::array<double, lookahead_frames> smoothed_{};  // the last gains, for their mean
  double gain_ = 1.0;
  double released_ = 1.0;
  double release_ = 0.0;
  double deepest_ = 1.0;
  std::size_t at_ = 0;
  std::size_t calm_ = 0;  // samples since the last above the ceiling
};

}  // namespace ressort::engine
