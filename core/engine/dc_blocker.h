// core/engine: removes DC, such as the rest positions of inputs, from the outputs.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <span>

#include "core/kernels/isa.h"
#include "core/rooms.h"

namespace ressort::engine {

// The last samples of a channel, the newest one last.
struct DcState {
  double in = 0.0;
  std::array<double, 3> change{};  // x[n] - x[n-1]
  std::array<double, 4> out{};
};

struct DcPoles {
  std::array<double, 5> power;  // of the filter's pole
  double quick;                 // of the decay at zero input
};

// Filters channels in place. The bits depend neither on the machine nor on where a call ends.
using FilterDc = void (*)(std::span<double* const> channels, std::size_t frames,
                          const DcPoles& poles, DcState* states);

template <Isa isa>
FilterDc dc_filter();

// A first-order high-pass filter at 5 Hz for every channel:
//   y[n] = x[n] - x[n-1] + pole y[n-1]
// The state decays within milliseconds at zero input, so that a panic is silent at once.
class DcBlocker {
 public:
  static constexpr double corner_hz = 5.0;
  static constexpr std::size_t max_channels = 64;

  explicit DcBlocker(double rate_hz);
  // Filters in place. Sound without DC passes as it is, unless the filter still holds some of an
  // earlier sound. [audio] wait-free, O(frames * channels)
  void process(std::span<double* const> channels, std::size_t frames, bool has_dc = true);

 private:
  DcPoles poles_;
  FilterDc filter_;
  bool is_filtering_ = false;
  std::array<DcState, max_channels> states_{};
};

}  // namespace ressort::engine
