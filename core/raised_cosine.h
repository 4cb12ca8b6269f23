// core: the pulse of a blow, a raised cosine of any length in samples. It is sampled at the middle
// of each sample. A sample that appears as the pulse grows starts at 0, so timbre changes
// continuously with strength and key. A pulse of 1.5 samples or less is one sample.
#pragma once

#include <cmath>
#include <cstddef>
#include <numbers>

namespace ressort {

struct RaisedCosine {
  RaisedCosine() = default;
  // [audio] wait-free
  explicit RaisedCosine(double frames) {
    if (frames <= 1.5) {
      return;
    }
    const double samples = std::ceil(frames - 0.5);
    count = static_cast<std::size_t>(samples);
    turn = 2.0 * std::numbers::pi / frames;
    sum = samples - std::sin(turn * samples) / (2.0 * std::sin(0.5 * turn));
  }
  // Returns the n-th sample, n < count. The sum of all samples is 1.
  double at(std::size_t n) const {
    return (1.0 - std::cos(turn * (static_cast<double>(n) + 0.5))) / sum;
  }

  std::size_t count = 1;
  double turn = 2.0 * std::numbers::pi;  // phase increment per sample
  double sum = 2.0;                      // sum of 1 - cos over all samples
};

}  // namespace ressort
