#include "core/identification/blow.h"

#include <algorithm>
#include <cmath>

#include "core/format.h"

namespace ressort::identification {
namespace {

constexpr std::size_t most_channels = 16;
constexpr double lowest_rate_hz = 4000.0;
constexpr double loud = 0.02;  // Share of the peak above which the blow has begun.
// Share of the peak that counts as sound when the recording starts in digital silence.
constexpr double audible = 1e-5;
constexpr double noise_factor = 5.0;  // Ratio to the noise before the blow.
constexpr double gap_s = 0.001;       // A pause this long means that the blow has not begun yet.
constexpr double hop_s = 0.005;       // Two hops are half a period of the lowest tone.
constexpr std::size_t rise_hops = 3;  // Longest rise of a later blow.
constexpr double attack = 2.5;        // Least rise of a later blow: 8 dB.
constexpr double died_away = 0.5;     // Level at which another blow can be told from a beat.
constexpr double frame_s = 0.01;
constexpr double least_s = 0.3;  // Shortest analysed length, if the recording is that long.
// Number of consecutive samples at the peak that count as clipping.
constexpr std::size_t clipped_run = 3;
// Largest share of the sound after the blow that may be skipped because of clipping.
constexpr double most_skipped = 0.25;

std::string seconds(double s) {
  return formatted("%.3g s", s);
}

// Returns the magnitude of each sample in the loudest channel, with the channel means removed.
std::vector<double> magnitudes(const Recording& recording, const std::vector<double>& means) {
  std::vector<double> all(recording.channels[0].size());
  for (std::size_t c = 0; c < means.size(); ++c) {
    for (std::size_t n = 0; n < all.size(); ++n) {
      all[n] = std::max(all[n], std::fabs(recording.channels[c][n] - means[c]));
    }
  }
  return all;
}

std::size_t find_onset(const std::vector<double>& loudness, double peak, double rate_hz) {
  const auto gap = static_cast<std::size_t>(gap_s * rate_hz) + 1;
  std::size_t onset = 0;
  while (loudness[onset] <= loud * peak) {
    ++onset;
  }
  const std::size_t quiet = onset > gap ? onset - gap : 0;
  double square = 0.0;
  for (std::size_t n = 0; n < quiet; ++n) {
    square += loudness[n] * loudness[n];
  }
  const double noise = quiet > gap ? std::sqrt(square / static_cast<double>(quiet)) : 0.0;
  const double threshold = std::max(audible * peak, noise_factor * noise);
  for (std::size_t n = onset; n-- > 0 && onset - n <= gap;) {
    onset = loudness[n] > threshold ? n : onset;
  }
  return onset;
}

// Returns the onset of the last blow before the loudest sample, if a blow whose sound had begun to
// die away precedes it; otherwise `first`.
std::size_t find_loudest_blow(const std::vector<double>& loudness, std::size_t first,
                              double rate_hz) {
  const auto hop = static_cast<std::size_t>(hop_s * rate_hz);
  const auto peak = static_cast<std::size_t>(std::ranges::max_element(loudness) - loudness.begin());
  std::vector<double> levels;  // the largest magnitude of each hop and the next one
  for (std::size_t at = first; at + 2 * hop <= loudness.size() && at <= peak; at += hop) {
    const auto begin = loudness.begin() + static_cast<std::ptrdiff_t>(at);
    levels.push_back(*std::max_element(begin, begin + static_cast<std::ptrdiff_t>(2 * hop)));
  }
  double loudest_before = 0.0;
  std::size_t found = first;
  for (std::size_t k = 0; k + rise_hops < levels.size(); ++k) {
    loudest_before = std::max(loudest_before, levels[k]);
    const bool has_died_away = levels[k] < died_away * loudest_before;
    const double after =
        *std::max_element(levels.begin() + static_cast<std::ptrdiff_t>(k),
                          levels.begin() + static_cast<std::ptrdiff_t>(k + rise_hops + 1));
    if (has_died_away && after > attack * levels[k] && after > died_away * loudness[peak]) {
      found = first + (k + 1) * hop;
      while (loudness[found] < std::max(2.0 * levels[k], audible * loudness[peak])) {
        ++found;
      }
    }
  }
  return found;
}

// Returns the number of samples to analyse from the onset: twice as many as exceed the noise at the
// end of the recording.
std::size_t find_length(const std::vector<double>& loudness, std::size_t onset, double rate_hz) {
  const std::size_t all = loudness.size() - onset;
  const auto frame = static_cast<std::size_t>(frame_s * rate_hz);
  std::vector<double> energies;
  for (std::size_t from = onset; from + frame <= loudness.size(); from += frame) {
    double energy = 0.0;
    for (std::size_t n = from; n < from + frame; ++n) {
      energy += loudness[n] * loudness[n];
    }
    energies.push_back(energy);
  }
  std::size_t ringing = all;
  if (energies.size() >= 16) {
    std::vector<double> tail(energies.end() - static_cast<std::ptrdiff_t>(energies.size() / 4),
                             energies.end());
    const auto middle = tail.begin() + static_cast<std::ptrdiff_t>(tail.size() / 2);
    std::nth_element(tail.begin(), middle, tail.end());
    std::size_t last = energies.size();
    while (last > 0 && energies[last - 1] < 1.5 * *middle) {
      --last;
    }
    ringing = std::max(2 * last * frame, static_cast<std::size_t>(least_s * rate_hz));
  }
  return std::min({all, ringing, static_cast<std::size_t>(longest_ring_s * rate_hz)});
}

struct Clipped {
  std::size_t count = 0;
  std::size_t end = 0;  // One past the last clipped sample.
};

Clipped find_clipped(const Recording& recording, double peak) {
  Clipped clipped;
  for (const std::vector<double>& channel : recording.channels) {
    std::size_t run = 0;
    for (std::size_t n = 0; n <= channel.size(); ++n) {
      const bool is_at_peak = n < channel.size() && std::fabs(channel[n]) >= peak * (1.0 - 1e-9);
      const bool is_same_run = is_at_peak && (run == 0 || channel[n] == channel[n - 1]);
      if (!is_same_run && run >= clipped_run) {
        clipped.count += run;
        clipped.end = std::max(clipped.end, n);
      }
      run = is_same_run ? run + 1 : is_at_peak ? 1 : 0;
    }
  }
  return clipped;
}

}  // namespace

Result<Blow> find_blow(const Recording& recording, bool skips_clipped) {
  const std::vector<std::vector<double>>& channels = recording.channels;
  if (channels.empty() || channels[0].empty()) {
    return Error{"the recording has no samples"};
  }
  if (channels.size() > most_channels) {
    return Error{"it has " + std::to_string(channels.size()) + " channels; at most " +
                 std::to_string(most_channels) + " are supported"};
  }
  if (!(recording.rate_hz >= lowest_rate_hz)) {
    return Error{"its sample rate is below 4000 Hz; record at a higher rate"};
  }
  const std::size_t frames = channels[0].size();
  std::vector<double> means;
  double largest = 0.0;
  for (std::size_t c = 0; c < channels.size(); ++c) {
    double sum = 0.0;
    for (std::size_t n = 0; n < frames; ++n) {
      if (!std::isfinite(channels[c][n])) {
        return Error{"the sample at " + seconds(static_cast<double>(n) / recording.rate_hz) +
                     " in channel " + std::to_string(c + 1) + " is not finite"};
      }
      sum += channels[c][n];
      largest = std::max(largest, std::fabs(channels[c][n]));
    }
    means.push_back(sum / static_cast<double>(frames));
  }
  const std::vector<double> loudness = magnitudes(recording, means);
  const double peak = *std::ranges::max_element(loudness);
  if (!(peak > 1e-12 * largest) || peak < 1e-30) {
    return Error{"it is silent: every sample is the same"};
  }
  const std::size_t onset = find_onset(loudness, peak, recording.rate_hz);
  Blow blow{.first = find_loudest_blow(loudness, onset, recording.rate_hz), .peak = peak};
  blow.is_first = blow.first == onset;
  const std::size_t left = frames - blow.first;
  blow.length_s = static_cast<double>(left) / recording.rate_hz;
  if (blow.length_s < shortest_ring_s) {
    return Error{"it ends " + seconds(blow.length_s) + " after the blow; at least " +
                 seconds(shortest_ring_s) + " of ringing are needed"};
  }
  const Clipped clipped = find_clipped(recording, largest);
  blow.clipped = clipped.count;
  const auto latest = static_cast<std::size_t>(most_skipped * static_cast<double>(left));
  if (skips_clipped && clipped.end > blow.first && clipped.end - blow.first <= latest) {
    blow.skipped = clipped.end - blow.first;
  }
  const std::size_t first = blow.first + blow.skipped;
  const std::size_t length = find_length(loudness, first, recording.rate_hz);
  for (std::size_t c = 0; c < channels.size(); ++c) {
    const auto from = channels[c].begin() + static_cast<std::ptrdiff_t>(first);
    blow.channels.emplace_back(from, from + static_cast<std::ptrdiff_t>(length));
    blow.offset = std::max(blow.offset, std::fabs(means[c]) / peak);
  }
  return blow;
}

}  // namespace ressort::identification
