#include "core/identification/bands.h"

#include <algorithm>
#include <bit>

namespace ressort::identification {

BandSplit::BandSplit(std::span<const double> samples)
    : frames_(samples.size()), size_(std::bit_ceil(std::max<std::size_t>(2, frames_ * 3 / 2))) {
  Fourier fourier(size_);
  bins_.resize(fourier.bins());
  std::vector<double> padded(samples.begin(), samples.end());
  padded.resize(size_);
  fourier.forward(padded, bins_);
}

std::vector<double> BandSplit::between(double low, double high, std::size_t step) const {
  Fourier fourier(std::max<std::size_t>(2, size_ / step));
  std::vector<std::complex<double>> part(fourier.bins());
  for (std::size_t k = 0; k < part.size(); ++k) {
    const double place = static_cast<double>(k) / static_cast<double>(size_);
    part[k] = place >= low && place < high ? bins_[k] / static_cast<double>(step) : 0.0;
  }
  std::vector<double> samples(fourier.size());
  fourier.inverse(part, samples);
  samples.resize((frames_ + step - 1) / step);
  return samples;
}

}  // namespace ressort::identification
