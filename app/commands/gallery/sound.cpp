#include "app/commands/gallery/sound.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <span>

namespace ressort::commands {
namespace {

// The frames of a stretch.
std::span<const double> part_of(const Sound& sound, std::size_t channel, Stretch stretch) {
  const auto frame = [&](double time_s) {
    const double frames = std::max(0.0, std::round(time_s * sound.rate_hz));
    return std::min(sound.frames(), static_cast<std::size_t>(frames));
  };
  const std::size_t first = frame(stretch.from_s);
  const std::size_t last = std::max(first, frame(stretch.to_s));
  return std::span(sound.channels[channel]).subspan(first, last - first);
}

double power_of(std::span<const double> samples) {
  double sum = 0.0;
  for (const double y : samples) {
    sum += y * y;
  }
  return sum;
}

double power_db(double power) {
  return power > 0.0 ? std::max(silence_db, 10.0 * std::log10(power)) : silence_db;
}

// A stretch of one channel under a window, ready for its spectrum at any frequency.
class Spectrum {
 public:
  Spectrum(std::span<const double> samples, double rate_hz)
      : samples_(samples.begin(), samples.end()), rate_hz_(rate_hz) {
    // The minimum 4-term window of Harris (1978), sidelobes at -92 dB.
    constexpr double a[] = {0.35875, 0.48829, 0.14128, 0.01168};
    const double step = 2.0 * std::numbers::pi / static_cast<double>(samples_.size());
    for (std::size_t n = 0; n < samples_.size(); ++n) {
      const double phase = step * (static_cast<double>(n) + 0.5);
      samples_[n] *= a[0] - a[1] * std::cos(phase) + a[2] * std::cos(2.0 * phase) -
                     a[3] * std::cos(3.0 * phase);
    }
    scale_ = 2.0 / (a[0] * static_cast<double>(samples_.size()));
  }

  // Of a steady sinusoid of amplitude 1: 1. O(frames)
  double amplitude(double frequency_hz) const {
    const double step = 2.0 * std::numbers::pi * frequency_hz / rate_hz_;
    const std::complex<double> turn = std::polar(1.0, -step);
    std::complex<double> sum = 0.0;
    constexpr std::size_t piece = 512;  // then the phase is set anew: it does not drift
    for (std::size_t at = 0; at < samples_.size(); at += piece) {
      std::complex<double> phase = std::polar(1.0, -step * static_cast<double>(at));
      for (std::size_t n = at; n < std::min(samples_.size(), at + piece); ++n) {
        sum += samples_[n] * phase;
        phase *= turn;
      }
    }
    return scale_ * std::abs(sum);
  }

 private:
  std::vector<double> samples_;
  double rate_hz_;
  double scale_ = 0.0;
};

}  // namespace

double to_dbfs(double amplitude) {
  return power_db(amplitude * amplitude);
}

double cents_between(double from_hz, double to_hz) {
  return 1200.0 * std::log2(to_hz / from_hz);
}

double peak_dbfs(const Sound& sound) {
  double peak = 0.0;
  for (const std::vector<double>& channel : sound.channels) {
    for (const double y : channel) {
      peak = std::max(peak, std::fabs(y));
    }
  }
  return to_dbfs(peak);
}

double dc_dbfs(const Sound& sound, Stretch stretch) {
  double worst = 0.0;
  for (std::size_t c = 0; c < sound.channels.size(); ++c) {
    const auto samples = part_of(sound, c, stretch);
    double sum = 0.0;
    double weights = 0.0;
    for (std::size_t n = 0; n < samples.size(); ++n) {
      const double weight = 1.0 - std::cos(2.0 * std::numbers::pi * (static_cast<double>(n) + 0.5) /
                                           static_cast<double>(samples.size()));
      sum += weight * samples[n];
      weights += weight;
    }
    worst = std::max(worst, weights > 0.0 ? std::fabs(sum / weights) : 0.0);
  }
  return to_dbfs(worst);
}

std::optional<StereoImage> stereo_image(const Sound& sound) {
  if (sound.channels.size() < 2) {
    return std::nullopt;
  }
  const auto& left = sound.channels[0];
  const auto& right = sound.channels[1];
  const auto count = static_cast<double>(sound.frames());
  double l = 0.0, r = 0.0, ll = 0.0, rr = 0.0, lr = 0.0;
  for (std::size_t n = 0; n < sound.frames(); ++n) {
    l += left[n];
    r += right[n];
    ll += left[n] * left[n];
    rr += right[n] * right[n];
    lr += left[n] * right[n];
  }
  const double spread = (ll - l * l / count) * (rr - r * r / count);
  if (!(spread > 0.0)) {
    return std::nullopt;
  }
  return StereoImage{
      .correlation = (lr - l * r / count) / std::sqrt(spread),
      .mono_loss_db = power_db(0.5 * (ll + rr)) - power_db(0.25 * (ll + rr + 2.0 * lr))};
}

std::vector<double> levels_db(const Sound& sound, Stretch stretch, double step_s) {
  std::vector<double> powers;
  const auto step = std::max<std::size_t>(1, static_cast<std::size_t>(step_s * sound.rate_hz));
  for (std::size_t c = 0; c < sound.channels.size(); ++c) {
    const auto samples = part_of(sound, c, stretch);
    powers.resize(samples.size() / step);
    for (std::size_t i = 0; i < powers.size(); ++i) {
      powers[i] += power_of(samples.subspan(i * step, step));
    }
  }
  const auto count = static_cast<double>(step * sound.channels.size());
  for (double& power : powers) {
    power = power_db(power / count);
  }
  return powers;
}

std::optional<double> attack_ms(const Sound& sound, Stretch stretch) {
  constexpr double step_s = 0.005;
  const std::vector<double> levels = levels_db(sound, stretch, step_s);
  if (levels.empty()) {
    return std::nullopt;
  }
  const double highest = *std::max_element(levels.begin(), levels.end());
  if (highest <= silence_db) {
    return std::nullopt;
  }
  const auto there =
      std::find_if(levels.begin(), levels.end(), [&](double db) { return db >= highest - 6.0; });
  return 1e3 * step_s * static_cast<double>(there - levels.begin() + 1);
}

std::optional<double> t60_s(const Sound& sound, Stretch stretch) {
  constexpr double step_s = 0.01;
  constexpr double least_fall_db = 3.0;
  constexpr double fitted_db = 40.0;
  const std::vector<double> levels = levels_db(sound, stretch, step_s);
  const auto first = std::max_element(levels.begin(), levels.end());
  if (first == levels.end() || *first <= silence_db) {
    return std::nullopt;
  }
  const auto last =
      std::find_if(first, levels.end(), [&](double db) { return db < *first - fitted_db; });
  const auto count = static_cast<double>(last - first);
  if (count < 2.0) {  // gone within a window
    return last == levels.end() ? std::nullopt : std::optional(60.0 * step_s / fitted_db);
  }
  double t = 0.0, y = 0.0, tt = 0.0, ty = 0.0;
  for (auto at = first; at != last; ++at) {
    const double time_s = step_s * static_cast<double>(at - first);
    t += time_s;
    y += *at;
    tt += time_s * time_s;
    ty += time_s * *at;
  }
  const double slope = (count * ty - t * y) / (count * tt - t * t);  // dB a second
  const bool falls = -slope * step_s * count >= least_fall_db;
  return falls ? std::optional(-60.0 / slope) : std::nullopt;
}

std::optional<StrongPartial> partial_near(const Sound& sound, Stretch stretch, double frequency_hz,
                                          double cents) {
  constexpr double least_dbfs = -100.0;
  const double low = frequency_hz * std::exp2(-cents / 1200.0);
  const double high = std::min(frequency_hz * std::exp2(cents / 1200.0), 0.5 * sound.rate_hz);
  std::optional<StrongPartial> found;
  for (std::size_t c = 0; c < sound.channels.size(); ++c) {
    const auto samples = part_of(sound, c, stretch);
    if (samples.size() < 16) {
      continue;
    }
    const Spectrum spectrum(samples, sound.rate_hz);
    const double bin_hz = sound.rate_hz / static_cast<double>(samples.size());
    const auto steps = static_cast<std::size_t>(std::ceil((high - low) / bin_hz)) + 2;
    const double step_hz = (high - low) / static_cast<double>(steps);
    std::size_t best = 0;
    double most = -1.0;
    for (std::size_t i = 0; i <= steps; ++i) {
      const double amplitude = spectrum.amplitude(low + static_cast<double>(i) * step_hz);
      if (amplitude > most) {
        most = amplitude;
        best = i;
      }
    }
    if (best == 0 || best == steps) {
      continue;
    }
    // By the golden section: between its neighbours there is one maximum, the window's own lobe.
    double a = low + static_cast<double>(best - 1) * step_hz;
    double b = a + 2.0 * step_hz;
    constexpr double share = 0.6180339887498949;
    double x = b - share * (b - a);
    double z = a + share * (b - a);
    double at_x = spectrum.amplitude(x);
    double at_z = spectrum.amplitude(z);
    while (b - a > 1e-7 * a) {
      if (at_x > at_z) {
        b = z;
        z = x;
        at_z = at_x;
        x = b - share * (b - a);
        at_x = spectrum.amplitude(x);
      } else {
        a = x;
        x = z;
        at_x = at_z;
        z = a + share * (b - a);
        at_z = spectrum.amplitude(z);
      }
    }
    const StrongPartial partial{0.5 * (a + b), to_dbfs(spectrum.amplitude(0.5 * (a + b)))};
    if (partial.dbfs >= least_dbfs && (!found || partial.dbfs > found->dbfs)) {
      found = partial;
    }
  }
  return found;
}

}  // namespace ressort::commands
