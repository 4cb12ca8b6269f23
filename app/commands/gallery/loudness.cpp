#include <ebur128.h>

#include <memory>

#include "app/commands/gallery/sound.h"

namespace ressort::commands {

Result<double> loudness_lufs(const Sound& sound) {
  const auto close = [](ebur128_state* state) { ebur128_destroy(&state); };
  const auto channels = static_cast<unsigned>(sound.channels.size());
  const std::unique_ptr<ebur128_state, decltype(close)> state(
      ebur128_init(channels, static_cast<unsigned long>(sound.rate_hz), EBUR128_MODE_I), close);
  if (state == nullptr) {
    return Error{"the loudness at this rate, or of so many channels, cannot be measured"};
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
    return Error{"there is not enough memory to measure the loudness"};
  }
  return std::max(silence_db, lufs);  // of silence it is minus infinity
}

}  // namespace ressort::commands
