// core/engine: values that an engine reports.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/rooms.h"

namespace ressort::engine {

struct EngineMeters {
  int voices = 0;            // audible voices
  int stepped = 0;           // voices computed, inaudible ones included, fading ones excluded
  std::uint64_t resets = 0;  // voices that became unstable and were faded out
  std::uint64_t stolen = 0;  // voices stolen by a new note
  std::uint64_t shed = 0;    // voices ended by limit_voices()
  std::uint64_t beyond = 0;  // parameter changes clamped to the limits; of audio, clamped blocks
  double saved = 0.0;        // share of steps that were not needed, 0..1
  std::uint64_t modes = 0;   // modes of all awake voices
  std::uint64_t modes_awake = 0;
  // Energy of all stepped parts at the last reading, in mass * (position per sample at 44 100
  // Hz)^2.
  double energy = 0.0;
  double loss = 0.0;       // energy lost per second
  bool is_driven = false;  // some part was driven, so `loss` covers the other parts only
  bool is_whole = true;    // every part was read; if not, the total is larger
};

// The nodes and the number of leading waveguides of one part that a display shows.
struct WatchedPart {
  std::vector<std::uint32_t> nodes;
  std::size_t waveguides = 0;
};
// Bounds beyond which a voice is unstable: 60 dB above full scale, or not a number; in the bare
// network, whose outputs are positions, a value that no position reaches.
inline constexpr double runaway_level = 1e3;
inline constexpr double runaway = 1e9;

inline constexpr std::size_t max_parameter_changes = 64;

inline constexpr std::size_t waveguide_points = 33;  // points shown of each waveguide
inline constexpr double strobe_period_s = 2.0;       // period of the slow-motion display

}  // namespace ressort::engine
