// core: the pulse of a blow, a raised cosine over so many samples, whole or not. Samples are taken
// in their middles, and those that come in as it grows do so from 0: a harder touch, or a higher
// key, is brighter by no step. The pulse of 1.5 samples or less is one sample.
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
  // Its n-th sample, n < count: all of them together are 1.
  double at(std::size_t n) const {
    return (1.0 - std::cos(turn * (static_cast<double>(n) + 0.5))) / sum;
  }

  std::size_t count = 1;
  double turn = 2.0 * std::numbers::pi;  // from sample to sample
  double sum = 2.0;                      // of 1 - cos
};

}  // namespace ressort
