#include "core/analysis/timbre/pitch.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <complex>
#include <vector>

#include "core/analysis/timbre/frame_analysis.h"

namespace ressort::analysis {
namespace {

constexpr double lowest_hz = 50.0;
constexpr double highest_share = 0.2;  // Highest f0, relative to the rate.
// A shorter lag wins if its correlation is at least this share of the best.
constexpr double nearly_as_good = 0.93;
constexpr double good_enough = 0.6;     // Least normalised correlation; 1 is perfectly periodic.
constexpr double least_left = 1e-3;     // Least share of the energy that the second half must have.
constexpr double partial_apart = 0.06;  // Largest distance of a partial from f0: a semitone.
constexpr double partial_share = 0.01;  // Least amplitude of that partial, relative to the loudest.

}  // namespace

std::size_t pitch_samples(double rate_hz) {
  return std::bit_ceil(static_cast<std::size_t>(8.0 * rate_hz / lowest_hz));
}

std::optional<double> find_f0(std::span<const double> samples, double rate_hz) {
  const std::size_t count = samples.size();
  if (count < 16) {
    return std::nullopt;
  }
  double mean = 0.0;
  for (const double sample : samples) {
    mean += sample / static_cast<double>(count);
  }
  std::vector<double> padded(2 * std::bit_ceil(count));
  std::ranges::transform(samples, padded.begin(), [&](double sample) { return sample - mean; });
  std::vector<double> energy(count + 1);  // [n] Energy of the first n samples.
  for (std::size_t n = 0; n < count; ++n) {
    energy[n + 1] = energy[n] + padded[n] * padded[n];
  }
  if (!std::isfinite(energy[count]) || energy[count] == 0.0) {
    return std::nullopt;
  }
  Fourier fourier(padded.size());
  std::vector<std::complex<double>> bins(fourier.bins());
  fourier.forward(padded, bins);
  for (std::complex<double>& bin : bins) {
    bin = std::norm(bin);
  }
  fourier.inverse(bins, padded);

  const auto longest = std::min(count / 2, static_cast<std::size_t>(rate_hz / lowest_hz));
  const auto shortest = static_cast<std::size_t>(1.0 / highest_share);
  std::vector<double> likeness(longest + 2);
  for (std::size_t lag = 0; lag < likeness.size(); ++lag) {
    const double both = energy[count - lag] + energy[count] - energy[lag];
    likeness[lag] = both > 0.0 ? 2.0 * padded[lag] / both : 0.0;
  }
  // Skips the peak at lag 0: peaks count after the first negative value.
  std::size_t lag = 1;
  while (lag < longest && likeness[lag] > 0.0) {
    ++lag;
  }
  std::vector<std::size_t> peaks;
  double best = 0.0;
  for (lag = std::max(lag, shortest); lag < longest; ++lag) {
    if (likeness[lag] > likeness[lag - 1] && likeness[lag] >= likeness[lag + 1]) {
      peaks.push_back(lag);
      best = std::max(best, likeness[lag]);
    }
  }
  const auto first = std::ranges::find_if(
      peaks, [&](std::size_t peak) { return likeness[peak] >= nearly_as_good * best; });
  if (first == peaks.end() || best < good_enough) {
    return std::nullopt;
  }
  const double left = likeness[*first - 1];
  const double right = likeness[*first + 1];
  const double bend = left - 2.0 * likeness[*first] + right;
  const double top = static_cast<double>(*first) + (bend < 0.0 ? 0.5 * (left - right) / bend : 0.0);
  const double f0_hz = rate_hz / top;

  // Uses the second half, after the attack, unless the sound has ended by then.
  const std::size_t half =
      energy[count] - energy[count / 2] > least_left * energy[count] ? count / 2 : 0;
  FrameAnalysis frame({.rate_hz = rate_hz, .size = count - half});
  static_cast<void>(frame.next(samples.subspan(half)));
  const std::vector<Partial> partials = frame.partials();
  double loudest = 0.0;
  for (const Partial& partial : partials) {
    loudest = std::max(loudest, partial.amplitude);
  }
  Partial nearest;
  for (const Partial& partial : partials) {
    if (std::fabs(partial.frequency_hz / f0_hz - 1.0) < partial_apart &&
        partial.amplitude > std::max(nearest.amplitude, partial_share * loudest)) {
      nearest = partial;
    }
  }
  return nearest.amplitude > 0.0 ? nearest.frequency_hz : f0_hz;
}

}  // namespace ressort::analysis
