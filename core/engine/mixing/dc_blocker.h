// core/engine: takes from the outputs of an instrument what a loudspeaker cannot say: where its
// hands rest.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <span>

namespace ressort {

// A high-pass filter of first order at 5 Hz for every channel:
//   y[n] = x[n] - x[n-1] + pole y[n-1]
class DcBlocker {
 public:
  static constexpr double corner_hz = 5.0;
  static constexpr std::size_t max_channels = 64;

  explicit DcBlocker(double rate_hz)
      : pole_(std::exp(-2.0 * std::numbers::pi * corner_hz / rate_hz)) {}

  // In place. [audio] wait-free, O(frames * channels)
  void process(std::span<double* const> channels, std::size_t frames) {
    for (std::size_t c = 0; c < channels.size() && c < max_channels; ++c) {
      State state = states_[c];
      for (std::size_t n = 0; n < frames; ++n) {
        const double x = channels[c][n];
        state.out = x - state.in + pole_ * state.out;
        state.in = x;
        channels[c][n] = state.out;
      }
      states_[c] = state;
    }
  }

 private:
  struct State {
    double in = 0.0;
    double out = 0.0;
  };
  double pole_;
  std::array<State, max_channels> states_{};
};

}  // namespace ressort
