// core/engine: the output limiter.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "core/rooms.h"

namespace ressort::engine {

// A look-ahead limiter. The output never exceeds `ceiling` and is always finite. Input below the
// ceiling passes bit for bit, 48 frames later (1 ms at 48 kHz). All channels share one gain, so the
// stereo image does not move. No memory is allocated after construction.
class Limiter {
 public:
  static constexpr std::size_t lookahead_frames = 48;
  static constexpr std::size_t max_channels = 64;
  static constexpr double ceiling = 0.999;  // just below full scale of every sample format

  explicit Limiter(double rate_hz);

  // Limits in place. [audio] wait-free, O(frames * (channels + lookahead_frames)) at worst
  void process(std::span<double* const> channels, std::size_t frames);

  // Returns the lowest gain since the last call, 0..1. [audio]
  double take_reduction();

 private:
  void delay(std::span<double* const> channels, std::size_t frames);
  void limit(std::span<double* const> channels, std::size_t frames);

  std::array<std::array<double, lookahead_frames>, max_channels> delayed_{};
  std::array<double, lookahead_frames> wanted_{};    // gain that each delayed sample needs
  std::array<double, lookahead_frames> smoothed_{};  // recent values of released_, for their mean
  double gain_ = 1.0;
  double released_ = 1.0;
  double release_ = 0.0;
  double deepest_ = 1.0;
  std::size_t at_ = 0;
  std::size_t calm_ = 0;  // samples since the last one above the ceiling
};

}  // namespace ressort::engine
