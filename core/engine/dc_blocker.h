// core/engine: removes DC, such as the rest positions of inputs, from the outputs.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <span>

#include "core/rooms.h"

namespace ressort::engine {

// A first-order high-pass filter at 5 Hz for every channel:
//   y[n] = x[n] - x[n-1] + pole y[n-1]
// The state decays within milliseconds at zero input, so that a panic is silent at once.
class DcBlocker {
 public:
  static constexpr double corner_hz = 5.0;
  static constexpr std::size_t max_channels = 64;

  explicit DcBlocker(double rate_hz)
      : pole_(std::exp(-2.0 * std::numbers::pi * corner_hz / rate_hz)),
        quick_pole_(std::exp(-1.0 / (0.0005 * rate_hz))) {}

  // Filters in place. [audio] wait-free, O(frames * channels)
  void process(std::span<double* const> channels, std::size_t frames) {
    for (std::size_t c = 0; c < channels.size() && c < max_channels; ++c) {
      State state = states_[c];
      for (std::size_t n = 0; n < frames; ++n) {
        const double x = channels[c][n];
        const bool is_silent = x == 0.0 && state.in == 0.0;
        state.out = x - state.in + (is_silent ? quick_pole_ : pole_) * state.out;
        state.out = is_silent && std::fabs(state.out) < nothing ? 0.0 : state.out;
        state.in = x;
        channels[c][n] = state.out;
      }
      states_[c] = state;
    }
  }

 private:
  static constexpr double nothing = 1e-7;  // -140 dBFS
  struct State {
    double in = 0.0;
    double out = 0.0;
  };
  double pole_;
  double quick_pole_;
  std::array<State, max_channels> states_{};
};

}  // namespace ressort::engine
