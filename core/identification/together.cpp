// Identifies the modes of several recordings of one object.
#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

#include "core/identification/identify.h"

namespace ressort::identification {
namespace {

// Returns the elements of one recording, of those of all channels.
template <class T>
std::vector<T> of_recording(const std::vector<T>& all, std::size_t recording,
                            std::size_t channels) {
  const auto first = all.begin() + static_cast<std::ptrdiff_t>(recording * channels);
  return {first, first + static_cast<std::ptrdiff_t>(channels)};
}

// Returns how far a mode moves at the place of one recording, relative to that of another: the
// ratio of its amplitudes, below 0 in antiphase.
double relative_hit(const IdentifiedMode& mode, std::size_t recording, std::size_t reference,
                    std::size_t channels) {
  double square = 0.0;
  double reference_square = 1e-300;
  double common = 0.0;
  for (std::size_t c = 0; c < channels; ++c) {
    const std::size_t a = recording * channels + c;
    const std::size_t b = reference * channels + c;
    square += mode.amplitude[a].value * mode.amplitude[a].value;
    reference_square += mode.amplitude[b].value * mode.amplitude[b].value;
    common += mode.amplitude[a].value * mode.amplitude[b].value *
              std::cos(mode.phase_rad[a].value - mode.phase_rad[b].value);
  }
  return std::copysign(std::sqrt(square / reference_square), common);
}

}  // namespace

Result<Identification> identify_together(std::span<const Recording> recordings,
                                         const IdentifyOptions& options, const Progress& progress) {
  if (recordings.size() == 1) {
    return identify(recordings[0], options, progress);
  }
  Recording all{.rate_hz = recordings[0].rate_hz, .channels = {}};
  std::size_t frames = SIZE_MAX;
  std::vector<double> energies;
  for (const Recording& recording : recordings) {
    const auto blow = find_blow(recording, false);
    if (!blow) {
      return Error{"recording " + std::to_string(energies.size() + 1) + ": " +
                   blow.error().message};
    }
    double energy = 0.0;
    for (const std::vector<double>& channel : blow->channels) {
      energy = std::inner_product(channel.begin(), channel.end(), channel.begin(), energy);
      frames = std::min(frames, channel.size());
      all.channels.push_back(channel);
    }
    energies.push_back(energy);
  }
  for (std::vector<double>& channel : all.channels) {
    channel.resize(frames);
  }
  auto found = identify(all, options, progress);
  if (!found) {
    return found;
  }
  const std::size_t channels = recordings[0].channels.size();
  const auto reference =
      static_cast<std::size_t>(std::ranges::max_element(energies) - energies.begin());
  for (std::size_t r = 0; r < recordings.size(); ++r) {
    std::vector<double>& hits = found->hits.emplace_back();
    for (const IdentifiedMode& mode : found->modes) {
      hits.push_back(relative_hit(mode, r, reference, channels));
    }
  }
  found->sound = of_recording(found->sound, reference, channels);
  found->residual = of_recording(found->residual, reference, channels);
  for (IdentifiedMode& mode : found->modes) {
    mode.amplitude = of_recording(mode.amplitude, reference, channels);
    mode.phase_rad = of_recording(mode.phase_rad, reference, channels);
  }
  return found;
}

}  // namespace ressort::identification
