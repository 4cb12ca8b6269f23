// A whole sound file in memory.
#pragma once

#include <string>
#include <vector>

#include "app/session/sound_file.h"

namespace ressort {

// Channels of equal length, in full precision.
struct Sound {
  double rate_hz = 0.0;
  std::vector<std::vector<double>> channels;
};

inline Result<Sound> read_sound(const std::string& path) {
  auto file = SoundReader::open(path);
  if (!file) {
    return file.error();
  }
  const std::size_t channels = file->channels();
  Sound sound{.rate_hz = file->rate_hz(), .channels = {}};
  sound.channels.resize(channels);
  std::vector<double> block(4096 * channels);
  for (std::size_t got = 0; (got = file->read(block.data(), 4096)) > 0;) {
    for (std::size_t i = 0; i < got * channels; ++i) {
      sound.channels[i % channels].push_back(block[i]);
    }
  }
  return sound;
}

}  // namespace ressort
