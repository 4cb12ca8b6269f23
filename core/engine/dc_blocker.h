// core/engine: removes DC, such as the rest positions of inputs, from the outputs.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <span>

#include "core/lanes.h"
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
  using Two = Pack<double, 16>;  // consecutive samples of a channel
  // The last two samples.
  struct State {
    Two in{};
    Two change{};
    Two out{};  // out[1] is change[1] + pole * out[0].
  };

  // Computes each sample from the last but one, so that a sample waits half as long for another.
  Two next(State& state, Two in) const {
    const Two change = in - Two{state.in[1], in[0]};
    const Two late = pole_ * Two{state.change[1], change[0]};
    state = {in, change, change + late + pole_ * pole_ * state.out};
    return state.out;
  }

  static bool is_zero(const double* samples, std::size_t frames) {
    std::uint64_t bits = 0;
    for (std::size_t n = 0; n < frames; ++n) {
      bits |= std::bit_cast<std::uint64_t>(samples[n]) << 1;
    }
    return bits == 0;
  }

  void filter(double* channel, std::size_t frames, State& kept) const {
    State state = kept;
    if (state.out[1] == 0.0 && state.in[1] == 0.0 && is_zero(channel, frames)) {
      return;
    }
    for (std::size_t n = 0; n < frames; ++n) {
      const double x = channel[n];
      double change = 0.0;
      if (x == 0.0 && state.in[1] == 0.0) {
        const double y = quick_pole_ * state.out[1];
        channel[n] = std::fabs(y) < nothing ? 0.0 : y;
        state.out[0] = channel[n] / pole_;
      } else {
        change = x - state.in[1];
        channel[n] = change + pole_ * state.change[1] + pole_ * pole_ * state.out[0];
        state.out[0] = state.out[1];
      }
      state.in[1] = x;
      state.change[1] = change;
      state.out[1] = channel[n];
    }
    kept = state;
  }

  // Filters two channels at once, because samples wait for those before them, until one of them may
  // be silent. Returns the number of frames.
  std::size_t filter_pair(double* left, double* right, std::size_t frames, State* states) const {
    State l = states[0];
    State r = states[1];
    std::size_t n = 0;
    for (; n + 2 <= frames && left[n] * right[n] != 0.0; n += 2) {
      store(left + n, next(l, load<Two>(left + n)));
      store(right + n, next(r, load<Two>(right + n)));
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
