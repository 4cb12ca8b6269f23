#include "core/identification/spectrum.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

#include "core/identification/damped.h"
#include "core/linear_algebra/fourier.h"

namespace ressort::identification {

Power::Power(std::span<const std::vector<double>> channels, std::size_t frames) : frames_(frames) {
  const std::size_t size = std::bit_ceil(std::max<std::size_t>(frames, 2));
  Fourier fourier(size);
  std::vector<double> power(fourier.bins());
  std::vector<double> padded(size);
  std::vector<Complex> bins(fourier.bins());
  for (const std::vector<double>& channel : channels) {
    std::copy_n(channel.begin(), frames, padded.begin());
    fourier.forward(padded, bins);
    for (std::size_t k = 0; k < power.size(); ++k) {
      power[k] += (k == 0 || 2 * k == size ? 1.0 : 2.0) * std::norm(bins[k]) /
                  (static_cast<double>(size) * static_cast<double>(frames));
    }
  }
  sums_.push_back(0.0);
  for (const double bin : power) {
    sums_.push_back(sums_.back() + bin);
  }
}

double Power::between(double low_omega, double high_omega) const {
  const auto last = static_cast<double>(sums_.size() - 1);
  const auto place = [&](double omega) {
    return static_cast<std::size_t>(
        std::clamp(std::ceil(omega / std::numbers::pi * (last - 1.0)), 0.0, last));
  };
  return std::max(0.0, sums_[place(high_omega)] - sums_[place(low_omega)]);
}

double Power::density(double omega, double half_width) const {
  const auto bins = static_cast<double>(sums_.size() - 2);
  const double least = 4.0 * std::numbers::pi / bins;
  const double half = std::max(half_width, least);
  const double low = std::clamp(omega - half, 0.0, std::numbers::pi - 2.0 * half);
  return between(low, low + 2.0 * half) * std::numbers::pi / (2.0 * half);
}

double Power::floor(double omega, double half_width) const {
  const std::size_t bins = sums_.size() - 1;
  const double per_omega = static_cast<double>(bins - 1) / std::numbers::pi;
  const auto half = static_cast<std::size_t>(std::max(16.0, half_width * per_omega));
  const auto middle =
      static_cast<std::size_t>(std::clamp(omega, 0.0, std::numbers::pi) * per_omega);
  std::vector<double> around;
  for (std::size_t k = middle - std::min(middle, half); k < std::min(bins, middle + half); ++k) {
    around.push_back(sums_[k + 1] - sums_[k]);
  }
  const auto median = around.begin() + static_cast<std::ptrdiff_t>(around.size() / 2);
  std::nth_element(around.begin(), median, around.end());
  return *median / std::numbers::ln2 * static_cast<double>(bins - 1);
}

}  // namespace ressort::identification
