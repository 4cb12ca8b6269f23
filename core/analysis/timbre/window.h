// core/analysis/timbre: windows of a frame, as periodic sums of cosines. Pure. [any thread]
#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <vector>

#include "core/rooms.h"

namespace ressort::analysis {

enum class Window { hann, hamming, blackman, none };

// Coefficients a_0, a_1, a_2 of w[m] = sum of a_j cos(2 pi j m / size).
constexpr std::array<double, 3> window_cosines(Window window) {
  switch (window) {
    case Window::hann:
      return {0.5, -0.5, 0.0};
    case Window::hamming:
      return {0.54, -0.46, 0.0};
    case Window::blackman:
      return {0.42, -0.5, 0.08};
    case Window::none:
      break;
  }
  return {1.0, 0.0, 0.0};
}

// Returns w[m] for m < size; periodic, so that w[size] would equal w[0].
std::vector<double> window_weights(Window window, std::size_t size);

// Returns the sum of w[m] e^(log_z m) over the sum of w[m] in closed form: the windowed amplitude
// of an exponentially decaying partial whose first sample is 1. O(1)
std::complex<double> window_response(Window window, std::size_t size, std::complex<double> log_z);

}  // namespace ressort::analysis
