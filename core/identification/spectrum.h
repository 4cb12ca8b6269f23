// core/identification: how much of a sound lies where. [any thread but audio]
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "core/rooms.h"

namespace ressort::identification {

// The mean power of a stretch of sound over frequency, all channels added up.
class Power {
 public:
  Power(std::span<const std::vector<double>> channels, std::size_t frames);

  // Of one sample, between two omegas: all of them from 0 to pi give the mean square.
  double between(double low_omega, double high_omega) const;
  // Of one sample and bin, so that white noise gives its variance; over a few bins around.
  double density(double omega, double half_width) const;
  // The same, not of what stands out there but of what is between: by the median.
  double floor(double omega, double half_width) const;
  std::size_t frames() const { return frames_; }

 private:
  std::size_t frames_;
  std::vector<double> sums_;  // [bin] of all below
};

}  // namespace ressort::identification
