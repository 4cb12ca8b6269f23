// Splits a recording into its modes and its noise, to look at and to listen to.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include "app/commands/body/recording.h"

namespace ressort::commands {
namespace {

constexpr double highest_peak = 0.9;
constexpr double measured_s = 0.5;  // The loudness needs at least 0.4 s.

void scale(Sound& sound, double gain) {
  for (std::vector<double>& channel : sound.channels) {
    for (double& x : channel) {
      x *= gain;
    }
  }
}

Result<Done> write_sound(const std::string& path, const Sound& sound, bool force) {
  const std::size_t channels = sound.channels.size();
  auto file =
      SoundWriter::open(path, {.rate_hz = sound.rate_hz, .channels = static_cast<int>(channels)},
                        force ? Existing::replace : Existing::refuse);
  if (!file) {
    return file.error();
  }
  std::vector<double> interleaved(sound.frames() * channels);
  for (std::size_t i = 0; i < interleaved.size(); ++i) {
    interleaved[i] = sound.channels[i % channels][i / channels];
  }
  if (auto written = file->write(interleaved.data(), sound.frames()); !written) {
    return written;
  }
  return file->close();
}

}  // namespace

RecordingParts parts_of(const Identification& found, const std::vector<NoiseBand>& noise) {
  RecordingParts parts;
  const std::size_t frames = found.sound[0].size();
  parts.recording = {.rate_hz = found.rate_hz, .channels = found.sound};
  parts.residual = {.rate_hz = found.rate_hz, .channels = found.residual};
  parts.noise = {.rate_hz = found.rate_hz,
                 .channels = sound_of(noise, found.sound.size(), frames, found.rate_hz)};
  parts.modes = parts.recording;
  for (std::size_t c = 0; c < found.sound.size(); ++c) {
    for (std::size_t n = 0; n < frames; ++n) {
      parts.modes.channels[c][n] -= found.residual[c][n];
    }
  }
  parts.sum = parts.modes;
  for (std::size_t c = 0; c < found.sound.size(); ++c) {
    for (std::size_t n = 0; n < frames; ++n) {
      parts.sum.channels[c][n] += parts.noise.channels[c][n];
    }
  }
  return parts;
}

Result<Done> write_parts(const std::string& folder, RecordingParts parts, bool force) {
  std::error_code failure;
  std::filesystem::create_directories(folder, failure);
  if (failure) {
    return Error{"cannot make the folder '" + folder + "': " + failure.message()};
  }
  const std::pair<const char*, Sound*> files[] = {{"recording", &parts.recording},
                                                  {"modes", &parts.modes},
                                                  {"noise", &parts.noise},
                                                  {"sum", &parts.sum}};
  double peak = 1e-30;
  for (const auto& [name, sound] : files) {
    Sound padded = *sound;
    for (std::vector<double>& channel : padded.channels) {
      channel.resize(
          std::max(channel.size(), static_cast<std::size_t>(measured_s * sound->rate_hz)));
    }
    scale(padded, 1.0 / std::max(peak_of(*sound), 1e-30));
    const auto loudness = loudness_lufs(padded);
    if (!loudness) {
      return loudness.error();
    }
    if (peak_of(*sound) > 0.0) {
      scale(*sound, std::pow(10.0, -*loudness / 20.0) / peak_of(*sound));
    }
    peak = std::max(peak, peak_of(*sound));
  }
  for (const auto& [name, sound] : files) {
    scale(*sound, highest_peak / peak);
    if (auto written = write_sound(folder + "/" + name + ".wav", *sound, force); !written) {
      return written;
    }
  }
  return Done{};
}

}  // namespace ressort::commands
