// core/identification: splits a sound into frequency bands with lower sample rates. [any thread but
// audio]
#pragma once

#include <complex>
#include <cstddef>
#include <span>
#include <vector>

#include "core/linear_algebra/fourier.h"

namespace ressort::identification {

class BandSplit {
 public:
  explicit BandSplit(std::span<const double> samples);

  // Returns every `step`-th sample of the part from `low` to `high`, which are shares of the sample
  // rate. `step` is a power of two of at most 0.5 / high. O(samples / step * log samples)
  std::vector<double> between(double low, double high, std::size_t step) const;

 private:
  std::size_t frames_;
  std::size_t size_;  // frames with padding, so that the end of a band does not reach its start
  std::vector<std::complex<double>> bins_;
};

}  // namespace ressort::identification
