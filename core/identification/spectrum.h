// core/identification: power spectrum of a sound. [any thread but audio]
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "core/rooms.h"

namespace ressort::identification {

// Mean power of a stretch of sound over frequency, summed over all channels.
class Power {
 public:
  Power(std::span<const std::vector<double>> channels, std::size_t frames);

  // Returns the power per sample between two omegas; 0 to pi gives the mean square.
  double between(double low_omega, double high_omega) const;
  // Returns the power per sample and bin around omega; for white noise this is its variance.
  double density(double omega, double half_width) const;
  // Returns the same without peaks, by the median over the bins.
  double floor(double omega, double half_width) const;
  std::size_t frames() const { return frames_; }

 private:
  std::size_t frames_;
  std::vector<double> sums_;  // [bin] Cumulative sums.
};

}  // namespace ressort::identification
