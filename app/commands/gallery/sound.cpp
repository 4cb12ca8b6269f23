#include "app/commands/gallery/sound.h"

#include <ebur128.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <span>

namespace ressort::commands {
namespace {

// Returns the samples of a stretch.
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
  return std::inner_product(samples.begin(), samples.end(), samples.begin(), 0.0);
}

double power_db(double power) {
  return power > 0.0 ? std::max(silence_db, 10.0 * std::log10(power)) : silence_db;
}

}  // namespace

double to_dbfs(double amplitude) {
  return power_db(amplitude * amplitude);
}

double peak_of(const Sound& sound) {
  double peak = 0.0;
  for (const std::vector<double>& channel : sound.channels) {
    for (const double y : channel) {
      peak = std::max(peak, std::fabs(y));
    }
  }
  return peak;
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
  const double highest = *std::ranges::max_element(levels);
  if (highest <= silence_db) {
    return std::nullopt;
  }
  const auto there = std::ranges::find_if(levels, [&](double db) { return db >= highest - 6.0; });
  return 1e3 * step_s * static_cast<double>(there - levels.begin() + 1);
}

std::optional<double> t60_s(const Sound& sound, Stretch stretch) {
  constexpr double step_s = 0.01;
  constexpr double least_fall_db = 3.0;
  constexpr double fitted_db = 40.0;
  const std::vector<double> levels = levels_db(sound, stretch, step_s);
  const auto first = std::ranges::max_element(levels);
  if (first == levels.end() || *first <= silence_db) {
    return std::nullopt;
  }
  const auto last =
      std::find_if(first, levels.end(), [&](double db) { return db < *first - fitted_db; });
  const auto count = static_cast<double>(last - first);
  if (count < 2.0) {  // the sound ends within one window
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

Result<double> loudness_lufs(const Sound& sound) {
  const auto close = [](ebur128_state* state) { ebur128_destroy(&state); };
  const auto channels = static_cast<unsigned>(sound.channels.size());
  const std::unique_ptr<ebur128_state, decltype(close)> state(
      ebur128_init(channels, static_cast<unsigned long>(sound.rate_hz), EBUR128_MODE_I), close);
  if (state == nullptr) {
    return Error{"cannot measure the loudness at this sample rate or with so many channels"};
  }
  std::vector<double> interleaved(sound.frames() * channels);
  for (unsigned c = 0; c < channels; ++c) {
    for (std::size_t n = 0; n < sound.frames(); ++n) {
      interleaved[n * channels + c] = sound.channels[c][n];
    }
  }
  double lufs = silence_db;
  if (ebur128_add_frames_double(state.get(), interleaved.data(), sound.frames()) != 0 ||
      ebur128_loudness_global(state.get(), &lufs) != 0) {
    return Error{"out of memory while measuring the loudness"};
  }
  return std::max(silence_db, lufs);  // silence: minus infinity
}

}  // namespace ressort::commands
