#include "core/analysis/timbre/descriptors.h"

#include <algorithm>
#include <cmath>

namespace ressort::analysis {
namespace {

constexpr double rolloff_share = 0.95;
// Share of the largest value: 2011 paper; Toolbox R2021a uses -20 dB.
constexpr double effective_share = 0.4;
// Width of the soft threshold, as a share of the largest effort.
constexpr double soft_share = 0.1;

// Returns the largest, if all are valid amplitudes and one is above 0.
std::optional<double> largest_of(std::span<const double> amplitudes) {
  double largest = 0.0;
  for (const double amplitude : amplitudes) {
    if (!std::isfinite(amplitude) || amplitude < 0.0) {
      return std::nullopt;
    }
    largest = std::max(largest, amplitude);
  }
  return largest > 0.0 ? std::optional(largest) : std::nullopt;
}

}  // namespace

std::optional<SpectralShape> spectral_shape(std::span<const double> frequencies_hz,
                                            std::span<const double> spectrum, SpectrumKind kind) {
  const auto largest = largest_of(spectrum);
  if (!largest || frequencies_hz.size() != spectrum.size()) {
    return std::nullopt;
  }
  const auto count = static_cast<double>(spectrum.size());
  double sum = 0.0;  // Sum of squares relative to the largest, to avoid underflow.
  double energy = 0.0;
  double logs = 0.0;
  double a_logs = 0.0;
  double moment = 0.0;
  double f_sum = 0.0;
  double ff_sum = 0.0;
  double rest = 0.0;  // Numerator of decrease.
  for (std::size_t k = 0; k < spectrum.size(); ++k) {
    const double a = spectrum[k] / *largest;
    const double f = frequencies_hz[k];
    sum += a;
    energy += kind == SpectrumKind::magnitude ? a * a : a;
    const double log_a = std::log(a);
    logs += log_a;  // -infinity for 0, whose geometric mean is 0.
    a_logs += a > 0.0 ? a * log_a : 0.0;
    moment += f * a;
    f_sum += f;
    ff_sum += f * f;
    rest += k > 0 ? (a - spectrum[0] / *largest) / static_cast<double>(k) : 0.0;
  }
  SpectralShape shape;
  shape.centroid_hz = moment / sum;
  shape.flatness = std::min(1.0, std::exp(logs / count) / (sum / count));
  shape.crest = count / sum;
  double second = 0.0;
  double third = 0.0;
  double fourth = 0.0;
  const double entropy = std::log(sum) - a_logs / sum;  // -sum p log p.
  double below = 0.0;
  bool has_rolled_off = false;
  for (std::size_t k = 0; k < spectrum.size(); ++k) {
    const double a = spectrum[k] / *largest;
    const double p = a / sum;
    const double away = frequencies_hz[k] - shape.centroid_hz;
    second += away * away * p;
    third += away * away * p * away;
    fourth += away * away * p * (away * away);
    below += kind == SpectrumKind::magnitude ? a * a : a;
    if (!has_rolled_off && below >= rolloff_share * energy) {
      has_rolled_off = true;
      shape.rolloff95_hz = frequencies_hz[k];
    }
  }
  shape.spread_hz = std::sqrt(second);
  // A single frequency, up to rounding.
  if (shape.spread_hz <= 1e-12 * std::fabs(shape.centroid_hz)) {
    shape.spread_hz = 0.0;
  } else {
    shape.skewness = third / (second * shape.spread_hz);
    shape.kurtosis = fourth / (second * second);
  }
  shape.entropy = spectrum.size() > 1 ? std::clamp(entropy / std::log(count), 0.0, 1.0) : 0.0;
  const double width = count * ff_sum - f_sum * f_sum;
  if (width > 0.0) {
    shape.slope = (count * shape.centroid_hz - f_sum) / width;
  }
  if (const double above = sum - spectrum[0] / *largest; above > 0.0) {
    shape.decrease = rest / above;
  }
  return shape;
}

std::optional<double> spectral_flux(std::span<const double> before, std::span<const double> after) {
  const auto largest_before = largest_of(before);
  const auto largest_after = largest_of(after);
  if (!largest_before || !largest_after || before.size() != after.size()) {
    return std::nullopt;
  }
  double product = 0.0;
  double length_before = 0.0;
  double length_after = 0.0;
  for (std::size_t k = 0; k < before.size(); ++k) {
    const double a = before[k] / *largest_before;
    const double b = after[k] / *largest_after;
    product += a * b;
    length_before += a * a;
    length_after += b * b;
  }
  return std::clamp(1.0 - product / std::sqrt(length_before * length_after), 0.0, 1.0);
}

std::optional<HarmonicShape> harmonic_shape(std::span<const Partial> partials, double f0_hz) {
  double largest = 0.0;
  for (const Partial& partial : partials) {
    if (!std::isfinite(partial.amplitude) || !std::isfinite(partial.frequency_hz)) {
      return std::nullopt;
    }
    largest = std::max(largest, std::fabs(partial.amplitude));
  }
  if (!(largest > 0.0) || !(f0_hz > 0.0) || !std::isfinite(f0_hz)) {
    return std::nullopt;
  }
  const std::size_t count = partials.size();
  const auto amplitude = [&](std::size_t i) { return std::fabs(partials[i].amplitude) / largest; };
  HarmonicShape shape;
  double odd = 0.0;
  double even = 0.0;
  double away = 0.0;
  double sum = 0.0;
  double rough = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    const double a = amplitude(i);
    (i % 2 == 0 ? odd : even) += a * a;
    away += std::fabs(partials[i].frequency_hz - static_cast<double>(i + 1) * f0_hz) * a * a;
    sum += a;
    shape.tristimulus[i == 0 ? 0 : i < 4 ? 1 : 2] += a;
    double smooth = a;
    if (i > 0) {
      smooth = i + 1 < count ? (amplitude(i - 1) + a + amplitude(i + 1)) / 3.0
                             : (amplitude(i - 1) + a) / 2.0;
    }
    rough += std::fabs(a - smooth);
  }
  for (double& share : shape.tristimulus) {
    share /= sum;
  }
  shape.inharmonicity = 2.0 / f0_hz * away / (odd + even);
  if (even > 0.0) {
    shape.odd_to_even = odd / even;
  }
  shape.harmonic_deviation = largest * rough / static_cast<double>(count);
  return shape;
}

std::vector<Partial> harmonics_of(std::span<const Partial> partials, double f0_hz,
                                  std::size_t most) {
  std::vector<Partial> harmonics(f0_hz > 0.0 ? most : 0);
  for (std::size_t i = 0; i < harmonics.size(); ++i) {
    harmonics[i].frequency_hz = static_cast<double>(i + 1) * f0_hz;
  }
  for (const Partial& partial : partials) {
    const double number = std::round(partial.frequency_hz / f0_hz);
    if (number >= 1.0 && number <= static_cast<double>(harmonics.size())) {
      Partial& harmonic = harmonics[static_cast<std::size_t>(number) - 1];
      if (std::fabs(partial.amplitude) > harmonic.amplitude) {
        harmonic = {partial.frequency_hz, std::fabs(partial.amplitude)};
      }
    }
  }
  while (!harmonics.empty() && harmonics.back().amplitude == 0.0) {
    harmonics.pop_back();
  }
  return harmonics;
}

std::optional<double> noisiness(std::span<const Partial> harmonics, double energy) {
  if (!(energy > 0.0) || !std::isfinite(energy)) {
    return std::nullopt;
  }
  double harmonic = 0.0;
  for (const Partial& partial : harmonics) {
    harmonic += partial.amplitude * partial.amplitude;
  }
  return std::clamp(1.0 - harmonic / energy, 0.0, 1.0);
}

void EnvelopeSums::add(double value) {
  if (value > largest_) {
    largest_ = value;
    largest_at_ = count_;
  }
  sum_ += value;
  moment_ += static_cast<double>(count_) * value;
  ++count_;
}

void EnvelopeTimes::add(double value) {
  const double share = value / sums_.largest();
  for (; tenths_ < reached_.size(); ++tenths_) {
    const double threshold = static_cast<double>(tenths_ + 1) / 10.0;
    if (share < threshold) {
      break;
    }
    const double beyond = count_ == 0 ? 0.0 : (share - threshold) / (share - share_);
    reached_[tenths_] = static_cast<double>(count_) - beyond;
  }
  share_ = share;
  if (count_ >= sums_.largest_at() && value > 0.0) {
    const auto t = static_cast<double>(count_ - sums_.largest_at());
    const double y = std::log(share);
    so_far_.count += 1.0;
    so_far_.t += t;
    so_far_.y += y;
    so_far_.tt += t * t;
    so_far_.ty += t * y;
  }
  if (share > effective_share) {
    first_above_ = first_above_.value_or(count_);
    last_above_ = count_;
    decay_ = so_far_;
  }
  ++count_;
}

// A step counts if its effort exceeds the threshold; with softness above 0, in part as it
// approaches the threshold.
double EnvelopeTimes::attack(double softness) const {
  const auto effort = [&](std::size_t step) {  // From (step + 1) tenths to the next.
    return reached_[step + 1] - reached_[step];
  };
  const double most = 3.0 * (reached_[6] - reached_[2]) / 4.0;
  const auto is_weak = [&](std::size_t step) {
    const double over = effort(step) - most;
    return softness > 0.0 && most > 0.0 ? 0.5 + 0.5 * std::tanh(over / (softness * most))
           : over > 0.0                 ? 1.0
                                        : 0.0;
  };
  double start = reached_.front();
  for (std::size_t step = 0; step < 3; ++step) {
    start += is_weak(step) * (reached_[step + 1] - start);
  }
  double end = reached_.back();
  for (std::size_t step = 8; step >= 4; --step) {
    end += is_weak(step) * (reached_[step] - end);
  }
  return end - start;
}

std::optional<TemporalShape> EnvelopeTimes::shape(double rate_hz) const {
  if (tenths_ < reached_.size() || !first_above_) {
    return std::nullopt;
  }
  TemporalShape shape;
  shape.log_attack_time = std::log10(std::max(attack(0.0), 1.0) / rate_hz);
  shape.smooth_attack_s = std::max(attack(soft_share), 1.0) / rate_hz;
  shape.temporal_centroid_s = sums_.centroid() / rate_hz;
  shape.effective_duration_s = static_cast<double>(last_above_ - *first_above_ + 1) / rate_hz;
  const double width = decay_.count * decay_.tt - decay_.t * decay_.t;
  if (width > 0.0) {
    shape.decay_slope = rate_hz * (decay_.count * decay_.ty - decay_.t * decay_.y) / width;
  }
  return shape;
}

std::optional<TemporalShape> temporal_shape(std::span<const double> envelope, double rate_hz) {
  if (!largest_of(envelope)) {
    return std::nullopt;
  }
  EnvelopeSums sums;
  for (const double value : envelope) {
    sums.add(value);
  }
  EnvelopeTimes times(sums);
  for (const double value : envelope) {
    times.add(value);
  }
  return times.shape(rate_hz);
}

}  // namespace ressort::analysis
