// app/realtime: a look at what sounds, on its way out of the audio thread.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "app/rooms.h"

namespace ressort::realtime {

struct MotionFrame {
  static constexpr std::size_t most_numbers = 8192;
  static constexpr std::size_t heard_samples = 2048;

  std::uint64_t frame = 0;    // samples that had been played
  std::uint32_t picture = 0;  // as Sounding says; 0: nothing to look at
  std::size_t count = 0;      // of the numbers, as Engine::look() gives them
  std::vector<double> numbers = std::vector<double>(most_numbers);
  std::array<float, heard_samples> heard{};  // the last of the output, the mean of all channels
};

}  // namespace ressort::realtime
