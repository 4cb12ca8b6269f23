// core/engine: removes DC, such as the rest positions of inputs, from the outputs.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <span>
#include <utility>

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
    const std::size_t count = std::min(channels.size(), max_channels);
    for (std::size_t c = 0; c < count; c += 2) {
      const std::size_t other = c + 1 < count ? c + 1 : c;
      const bool is_pair = other > c;
      const std::size_t done =
          is_pair ? filter_pair(channels[c], channels[other], frames, &states_[c]) : 0;
      for (std::size_t one = c; one <= other; ++one) {
        filter(channels[one] + done, frames - done, states_[one]);
      }
    }
  }

 private:
  struct State {
    bool is_silent(double x) const { return x == 0.0 && in == 0.0; }
    double in = 0.0;
    double out = 0.0;
  };

  void filter(double* channel, std::size_t frames, State& kept) const {
    State state = kept;
    std::size_t n = 0;
    while (n < frames && state.out == 0.0 && state.is_silent(channel[n])) {
      ++n;
    }
    for (; n < frames; ++n) {
      const double x = channel[n];
      const bool is_silent = state.is_silent(x);
      state.out = x - state.in + (is_silent ? quick_pole_ : pole_) * state.out;
      state.out = is_silent && std::fabs(state.out) < nothing ? 0.0 : state.out;
      state.in = x;
      channel[n] = state.out;
    }
    kept = state;
  }

  // Filters two channels at once, because every sample waits for the one before it, until one of
  // them is silent. Returns the number of frames.
  std::size_t filter_pair(double* left, double* right, std::size_t frames, State* states) const {
    State l = states[0];
    State r = states[1];
    std::size_t n = 0;
    for (; n < frames && !l.is_silent(left[n]) && !r.is_silent(right[n]); ++n) {
      l.out = left[n] - l.in + pole_ * l.out;
      r.out = right[n] - r.in + pole_ * r.out;
      l.in = std::exchange(left[n], l.out);
      r.in = std::exchange(right[n], r.out);
    }
    states[0] = l;
    states[1] = r;
    return n;
  }

  static constexpr double nothing = 1e-7;  // -140 dBFS
  double pole_;
  double quick_pole_;
  std::array<State, max_channels> states_{};
};

}  // namespace ressort::engine
