#include "core/identification/noise_bands.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/identification/bands.h"
#include "core/noise.h"

namespace ressort::identification {
namespace {

constexpr double edges_hz[] = {20.0,   100.0,  200.0,  300.0,  450.0,   700.0,   1000.0, 1500.0,
                               2200.0, 3200.0, 4700.0, 7000.0, 10000.0, 14000.0, 20000.0};
constexpr double longest_frame_s = 0.003;
constexpr double least_share = 1e-6;

// Returns the energy of each frame of the band.
std::vector<double> frame_energies(const std::vector<double>& samples, std::size_t frame) {
  std::vector<double> energies;
  for (std::size_t from = 0; from < samples.size(); from += frame) {
    double energy = 0.0;
    for (std::size_t n = from; n < std::min(samples.size(), from + frame); ++n) {
      energy += samples[n] * samples[n];
    }
    energies.push_back(energy);
  }
  return energies;
}

}  // namespace

std::vector<NoiseBand> noise_bands(const Identification& found) {
  const std::size_t frame = std::bit_floor(
      std::max<std::size_t>(1, static_cast<std::size_t>(longest_frame_s * found.rate_hz)));
  double sound = 0.0;
  for (const std::vector<double>& channel : found.sound) {
    for (const double x : channel) {
      sound += x * x;
    }
  }
  const std::vector<BandSplit> splits(found.residual.begin(), found.residual.end());
  std::vector<NoiseBand> bands;
  for (std::size_t b = 0; b + 1 < std::size(edges_hz) && edges_hz[b] < 0.45 * found.rate_hz; ++b) {
    NoiseBand band{.low_hz = edges_hz[b],
                   .high_hz = std::min(edges_hz[b + 1], 0.5 * found.rate_hz)};
    // A low band needs few samples, but some in each frame.
    const std::size_t step =
        std::min(std::max<std::size_t>(1, frame / 4),
                 std::bit_floor(static_cast<std::size_t>(0.5 * found.rate_hz / band.high_hz)));
    std::vector<double> all;
    std::vector<double> of_channel;
    for (const BandSplit& split : splits) {
      std::vector<double> energies = frame_energies(
          split.between(band.low_hz / found.rate_hz, band.high_hz / found.rate_hz, step),
          frame / step);
      // The steady noise of the room is that of the end.
      std::vector<double> tail(
          energies.begin() + static_cast<std::ptrdiff_t>(energies.size() * 3 / 4), energies.end());
      const auto middle = tail.begin() + static_cast<std::ptrdiff_t>(tail.size() / 2);
      std::nth_element(tail.begin(), middle, tail.end());
      double sum = 0.0;
      all.resize(energies.size());
      for (std::size_t i = 0; i < energies.size(); ++i) {
        const double above = static_cast<double>(step) * std::max(0.0, energies[i] - *middle);
        all[i] += above;
        sum += above;
      }
      of_channel.push_back(sum);
    }
    const auto loudest = static_cast<std::size_t>(std::ranges::max_element(all) - all.begin());
    double energy = 0.0;
    double moment = 0.0;
    double whole = 0.0;
    for (std::size_t i = 0; i < all.size(); ++i) {
      whole += all[i];
      energy += i >= loudest ? all[i] : 0.0;
      moment += i >= loudest ? all[i] * (static_cast<double>(i - loudest) + 0.5) : 0.0;
    }
    if (!(whole > least_share * sound) || !(energy > 0.0)) {
      continue;
    }
    // The energy of an exponential decay is centred at 1 / (2 alpha).
    const double centre_s = moment / energy * static_cast<double>(frame) / found.rate_hz;
    band.t60_s = std::log(1000.0) * 2.0 * centre_s;
    for (const double sum : of_channel) {
      band.level.push_back(std::sqrt(sum / (centre_s * found.rate_hz)));
    }
    bands.push_back(std::move(band));
  }
  return bands;
}

std::vector<std::vector<double>> sound_of(const std::vector<NoiseBand>& bands, std::size_t channels,
                                          std::size_t frames, double rate_hz) {
  std::vector<std::vector<double>> sound(channels, std::vector<double>(frames));
  for (std::size_t b = 0; b < bands.size(); ++b) {
    BandNoise noise(b + 1, bands[b].low_hz, bands[b].high_hz, rate_hz);
    const double decay = std::pow(10.0, -3.0 / (bands[b].t60_s * rate_hz));
    double envelope = 1.0;
    for (std::size_t n = 0; n < frames; ++n) {
      const double y = envelope * noise.next();
      envelope *= decay;
      for (std::size_t c = 0; c < channels; ++c) {
        sound[c][n] += bands[b].level[c] * y;
      }
    }
  }
  return sound;
}

}  // namespace ressort::identification
