// app/realtime: a snapshot of the moving model, sent from the audio thread to the panel.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "app/rooms.h"

namespace ressort::realtime {

struct MotionFrame {
  static constexpr std::size_t most_numbers = 8192;
  static constexpr std::size_t heard_samples = 2048;

  std::uint64_t frame = 0;    // samples played so far
  std::uint32_t picture = 0;  // PlayingEngine::picture; 0: nothing to draw
  std::size_t count = 0;      // numbers in use, as Engine::read_positions() returns them
  std::vector<double> numbers = std::vector<double>(most_numbers);
  std::array<float, heard_samples> heard{};  // the latest output, mean of all channels
};

}  // namespace ressort::realtime
