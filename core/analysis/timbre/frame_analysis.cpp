#include "core/analysis/timbre/frame_analysis.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

namespace ressort::analysis {
namespace {

// Largest distance of a partial from its peak bin; farther peaks are side lobes of another partial.
constexpr double farthest_bin = 0.75;

// Smallest amplitude of a partial, relative to the loudest; smaller peaks are rounding errors.
constexpr double quietest_share = 1e-5;

double square(double x) {
  return x * x;
}

// Returns the spectrum of a Hann window at this distance in bins, relative to 0 bins.
double hann_lobe(double bins) {
  const double turn = std::numbers::pi * bins;
  const double sinc = std::fabs(turn) < 1e-9 ? 1.0 : std::sin(turn) / turn;
  return sinc / (1.0 - bins * bins);
}

}  // namespace

FrameAnalysis::FrameAnalysis(const FrameOptions& options)
    : options_(options),
      fourier_(options.size),
      bins_(fourier_.bins()),
      spectrum_(fourier_.bins()),
      before_(fourier_.bins()) {
  for (std::size_t k = 0; k < fourier_.bins(); ++k) {
    frequencies_hz_.push_back(static_cast<double>(k) * options.rate_hz /
                              static_cast<double>(options.size));
  }
}

FrameAnalysis::Complex FrameAnalysis::raw(std::ptrdiff_t bin) const {
  const auto size = static_cast<std::ptrdiff_t>(options_.size);
  const auto last = static_cast<std::ptrdiff_t>(bins_.size()) - 1;
  return bin < 0      ? std::conj(bins_[static_cast<std::size_t>(-bin)])
         : bin > last ? std::conj(bins_[static_cast<std::size_t>(size - bin)])
                      : bins_[static_cast<std::size_t>(bin)];
}

// A cosine-sum window is a convolution with neighbouring bins.
FrameAnalysis::Complex FrameAnalysis::windowed(std::size_t bin, Window window) const {
  const auto cosines = window_cosines(window);
  const auto k = static_cast<std::ptrdiff_t>(bin);
  Complex sum = cosines[0] * raw(k);
  for (std::ptrdiff_t j = 1; j < 3; ++j) {
    if (const double cosine = cosines[static_cast<std::size_t>(j)]; cosine != 0.0) {
      sum += 0.5 * cosine * (raw(k - j) + raw(k + j));
    }
  }
  return sum;
}

FrameTimbre FrameAnalysis::next(std::span<const double> samples) {
  FrameTimbre timbre;
  const auto size = static_cast<double>(options_.size);
  const double sum = std::inner_product(samples.begin(), samples.end(), samples.begin(), 0.0);
  std::swap(before_, spectrum_);
  if (!std::isfinite(sum)) {
    std::fill(bins_.begin(), bins_.end(), Complex());
    std::fill(spectrum_.begin(), spectrum_.end(), 0.0);
    has_before_ = true;
    return timbre;
  }
  timbre.rms = std::sqrt(sum / size);
  fourier_.forward(samples, bins_);
  const double scale = 2.0 / (window_cosines(options_.window)[0] * size);
  for (std::size_t k = 0; k < bins_.size(); ++k) {
    const double amplitude = scale * std::sqrt(std::norm(windowed(k, options_.window)));
    spectrum_[k] = options_.kind == SpectrumKind::magnitude ? amplitude : amplitude * amplitude;
  }
  timbre.shape = spectral_shape(frequencies_hz_, spectrum_, options_.kind);
  if (has_before_) {
    timbre.flux = spectral_flux(before_, spectrum_);
  }
  has_before_ = true;
  if (options_.f0_hz && timbre.shape) {
    const auto harmonics = harmonics_of(partials(), *options_.f0_hz);
    timbre.harmonics = harmonic_shape(harmonics, *options_.f0_hz);
    double energy = 0.0;
    for (std::size_t k = 1; k < bins_.size(); ++k) {
      energy +=
          // Equivalent noise bandwidth of the window.
          square(4.0 / size * std::abs(windowed(k, Window::hann))) / 1.5;
    }
    timbre.noisiness = noisiness(harmonics, energy);
  }
  return timbre;
}

std::vector<Partial> FrameAnalysis::partials() const {
  const auto size = static_cast<double>(options_.size);
  std::vector<Partial> found;
  std::vector<double> level(bins_.size());
  for (std::size_t k = 0; k < bins_.size(); ++k) {
    level[k] = std::norm(windowed(k, Window::hann));
  }
  const double least = square(quietest_share) * *std::ranges::max_element(level);
  for (std::size_t k = 1; k + 1 < bins_.size(); ++k) {
    if (!(level[k] > level[k - 1]) || level[k] < level[k + 1] || level[k] < least) {
      continue;
    }
    // Reassignment: the spectrum with the window's derivative over that with the window is i times
    // the distance in bins between here and the partial, plus its decay.
    const auto bin = static_cast<std::ptrdiff_t>(k);
    const Complex slope = 0.25 * (raw(bin - 1) - raw(bin + 1)) / Complex(0.0, 1.0);
    const double away = -(slope / windowed(k, Window::hann)).imag();
    if (std::fabs(away) < farthest_bin) {
      const double amplitude = 4.0 / size * std::sqrt(level[k]) / hann_lobe(away);
      found.push_back({(static_cast<double>(k) + away) * options_.rate_hz / size, amplitude});
    }
  }
  return found;
}

FrameStream::FrameStream(const FrameOptions& options, std::size_t hop, Sink sink)
    : size_(options.size), hop_(hop), sink_(std::move(sink)), analysis_(options) {}

void FrameStream::add(std::span<const double> samples) {
  samples_.insert(samples_.end(), samples.begin(), samples.end());
  while (next_ + size_ <= first_ + samples_.size()) {
    const FrameTimbre timbre = analysis_.next(std::span(samples_).subspan(next_ - first_, size_));
    sink_(next_, timbre, analysis_);
    next_ += hop_;
  }
  // A hop longer than a frame skips samples.
  const std::size_t done = std::min(next_ - first_, samples_.size());
  samples_.erase(samples_.begin(), samples_.begin() + static_cast<std::ptrdiff_t>(done));
  first_ += done;
}

}  // namespace ressort::analysis
