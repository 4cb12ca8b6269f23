// tests: sounds with known modes, and the errors of an identification. Independent of core.
#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "core/identification/identify.h"
#include "tests/support/catch.h"
#include "tests/support/random.h"
#include "tests/support/rooms.h"

namespace ressort::support {

struct KnownMode {
  double frequency_hz = 0.0;
  double t60_s = 0.0;
  double amplitude = 0.0;
  double phase_rad = 0.0;

  double alpha() const { return std::log(1000.0) / t60_s; }  // 1/s
};

inline double gaussian(Random& random) {
  return std::sqrt(-2.0 * std::log(random.uniform(1e-300, 1.0))) *
         std::cos(2.0 * std::numbers::pi * random.uniform(0.0, 1.0));
}

inline std::vector<double> ringing(const std::vector<KnownMode>& modes, double seconds,
                                   double rate_hz = 44100.0) {
  std::vector<double> sound(static_cast<std::size_t>(seconds * rate_hz));
  for (const KnownMode& mode : modes) {
    for (std::size_t n = 0; n < sound.size(); ++n) {
      const double t = static_cast<double>(n) / rate_hz;
      sound[n] += mode.amplitude * std::exp(-mode.alpha() * t) *
                  std::cos(2.0 * std::numbers::pi * mode.frequency_hz * t + mode.phase_rad);
    }
  }
  return sound;
}

inline double peak_of(const std::vector<double>& sound) {
  double peak = 0.0;
  for (const double x : sound) {
    peak = std::max(peak, std::fabs(x));
  }
  return peak;
}

inline std::vector<double> with_noise(std::vector<double> sound, double deviation, Random& random) {
  for (double& x : sound) {
    x += deviation * gaussian(random);
  }
  return sound;
}

// Quantises to `bits` with the peak at 0.9 of full scale.
inline std::vector<double> quantised(std::vector<double> sound, int bits) {
  const double scale = 0.9 * (std::pow(2.0, bits - 1) - 1.0) / peak_of(sound);
  for (double& x : sound) {
    x = std::round(x * scale) / scale;
  }
  return sound;
}

// Modes typical of a metal object: higher ones decay faster; 0 to 30 dB below the loudest.
inline std::vector<KnownMode> random_modes(Random& random, std::size_t count, double low_hz,
                                           double high_hz, double least_distance_hz) {
  std::vector<KnownMode> modes;
  while (modes.size() < count) {
    KnownMode mode{.frequency_hz = low_hz * std::pow(high_hz / low_hz, random.uniform(0.0, 1.0)),
                   .amplitude = std::pow(10.0, random.uniform(-30.0, 0.0) / 20.0),
                   .phase_rad = random.uniform(-std::numbers::pi, std::numbers::pi)};
    mode.t60_s = 5.0 * std::pow(110.0 / mode.frequency_hz, 0.75) * random.uniform(0.7, 1.3);
    if (std::none_of(modes.begin(), modes.end(), [&](const KnownMode& other) {
          return std::fabs(other.frequency_hz - mode.frequency_hz) < least_distance_hz;
        })) {
      modes.push_back(mode);
    }
  }
  std::sort(modes.begin(), modes.end(),
            [](const KnownMode& a, const KnownMode& b) { return a.frequency_hz < b.frequency_hz; });
  return modes;
}

// Errors of the identified modes; both lists by frequency, one channel, phases at the start.
struct Misses {
  double frequency_hz = 0.0;
  double t60_percent = 0.0;
  double amplitude_db = 0.0;
  double phase_rad = 0.0;
};

inline Misses miss_of(const KnownMode& known, const IdentifiedMode& found, double time_zero_s,
                      std::size_t channel = 0) {
  const double amplitude = known.amplitude * std::exp(-known.alpha() * time_zero_s);
  const double phase = known.phase_rad + 2.0 * std::numbers::pi * known.frequency_hz * time_zero_s;
  return {
      std::fabs(found.frequency_hz.value - known.frequency_hz),
      100.0 * std::fabs(found.t60_s.value / known.t60_s - 1.0),
      20.0 * std::fabs(std::log10(found.amplitude[channel].value / amplitude)),
      std::fabs(std::remainder(found.phase_rad[channel].value - phase, 2.0 * std::numbers::pi))};
}

inline Misses worst_of(const std::vector<KnownMode>& known, const Identification& found,
                       double blow_s = 0.0) {
  REQUIRE(found.modes.size() == known.size());
  Misses worst;
  for (std::size_t k = 0; k < known.size(); ++k) {
    const Misses miss = miss_of(known[k], found.modes[k], found.time_zero_s - blow_s);
    worst.frequency_hz = std::max(worst.frequency_hz, miss.frequency_hz);
    worst.t60_percent = std::max(worst.t60_percent, miss.t60_percent);
    worst.amplitude_db = std::max(worst.amplitude_db, miss.amplitude_db);
    worst.phase_rad = std::max(worst.phase_rad, miss.phase_rad);
  }
  return worst;
}

inline Identification identified(std::vector<std::vector<double>> channels,
                                 double rate_hz = 44100.0, const IdentifyOptions& options = {}) {
  auto found = identify({rate_hz, std::move(channels)}, options, {});
  INFO((found ? std::string() : found.error().message));
  REQUIRE(found);
  return *std::move(found);
}

}  // namespace ressort::support
