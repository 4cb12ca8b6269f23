#include "core/analysis/timbre/envelope.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "core/analysis/timbre/window.h"

namespace ressort::analysis {
namespace {

constexpr std::size_t block_samples = 4096;  // Effective length of the Hilbert kernel 1/t.

double step(const std::array<double, 3>& b, const std::array<double, 3>& a,
            std::array<double, 3>& z, double x) {
  const double y = b[0] * x + z[0];
  z[0] = b[1] * x - a[1] * y + z[1];
  z[1] = b[2] * x - a[2] * y;
  return y;
}

}  // namespace

EnvelopeFilter::EnvelopeFilter(double rate_hz) {
  // Bilinear transform of (s + 1) (s^2 + s + 1), with s = (1 - z^-1)/(1 + z^-1)/k. Its group delay
  // at 0 Hz is 1/k samples.
  const double k = std::tan(std::numbers::pi * Envelope::cutoff_hz / rate_hz);
  one_b_ = {k / (1.0 + k), k / (1.0 + k), 0.0};
  one_a_ = {1.0, (k - 1.0) / (k + 1.0), 0.0};
  const double scale = 1.0 / (1.0 + k + k * k);
  two_b_ = {k * k * scale, 2.0 * k * k * scale, k * k * scale};
  two_a_ = {1.0, 2.0 * (k * k - 1.0) * scale, (1.0 - k + k * k) * scale};
  delay_ = std::llround(1.0 / k);
}

double EnvelopeFilter::next(double magnitude) {
  return std::max(0.0, step(two_b_, two_a_, two_z_, step(one_b_, one_a_, one_z_, magnitude)));
}

Envelope::Envelope(double rate_hz, std::function<void(double)> sink)
    : block_(block_samples),
      sink_(std::move(sink)),
      fourier_(4 * block_),
      window_(window_weights(Window::hann, 2 * block_)),
      samples_(3 * block_),
      frame_(4 * block_),
      bins_(fourier_.bins()),
      turned_(4 * block_),
      next_(-2 * static_cast<long long>(block_)),
      filter_(rate_hz) {}

void Envelope::add(std::span<const double> samples) {
  came_ += static_cast<long long>(samples.size());
  for (const double sample : samples) {
    take(sample);
  }
}

void Envelope::end() {
  while (told_ < came_) {
    take(0.0);
  }
}

void Envelope::take(double sample) {
  samples_[2 * block_ + filled_++] = sample;
  if (filled_ == block_) {
    transform();
    filled_ = 0;
  }
}

// Adds the Hilbert transform of the two newest blocks, windowed (overlap-add). The block two blocks
// back is then complete.
void Envelope::transform() {
  std::fill(frame_.begin(), frame_.end(), 0.0);
  for (std::size_t n = 0; n < 2 * block_; ++n) {
    frame_[block_ + n] = window_[n] * samples_[block_ + n];
  }
  fourier_.forward(frame_, bins_);
  for (std::complex<double>& bin : bins_) {
    bin = {bin.imag(), -bin.real()};
  }
  bins_.front() = bins_.back() = 0.0;
  fourier_.inverse(bins_, frame_);
  for (std::size_t n = 0; n < turned_.size(); ++n) {
    turned_[n] += frame_[n];
  }
  for (std::size_t n = 0; n < block_; ++n, ++next_) {
    if (next_ >= 0) {
      smooth(std::hypot(samples_[n], turned_[n]));
    }
  }
  const auto block = static_cast<std::ptrdiff_t>(block_);
  std::fill(std::copy(turned_.begin() + block, turned_.end(), turned_.begin()), turned_.end(), 0.0);
  std::copy(samples_.begin() + block, samples_.end(), samples_.begin());
}

void Envelope::smooth(double magnitude) {
  const double level = filter_.next(next_ < came_ ? magnitude : 0.0);
  if (next_ >= filter_.delay() && told_ < came_) {
    ++told_;
    sink_(level);
  }
}

}  // namespace ressort::analysis
