// core/engine: the LFOs of all voices. They move pitch, level and parameters of each note by
// itself.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/engine/keyboard.h"
#include "core/lfo.h"

namespace ressort::engine {

// Costs nothing if the preset has no LFO. All functions but the constructor: [audio] wait-free,
// O(voices * LFOs).
class Lfos {
 public:
  Lfos(const Playing& playing, double rate_hz);
  void continue_from(const Lfos& from);

  // Restarts the LFOs of a voice at a key press. `note` is the number of the note, the seed of its
  // random differences.
  void restart(std::size_t lane, std::uint64_t note, Keyboard& keyboard);
  // Follows the level at which the latest note is struck.
  void follow_level(std::size_t lane, Keyboard& keyboard);
  // Follows a controller or the pressure that scales a depth.
  void scale(Source source, int number, double amount, const Scope& scope,
             const Keyboard& keyboard);
  // Sets the rate of the LFOs in beats.
  void set_tempo(double beats_per_s);
  // Advances all LFOs. Called once in max_block_frames.
  void advance(Keyboard& keyboard);

 private:
  void apply(std::size_t lane, Keyboard& keyboard);

  const Playing& playing_;
  double block_s_;
  std::size_t count_;
  double beats_per_s_ = usual_beats_per_s;
  std::vector<LfoState> states_;        // [lane][lfo]
  std::vector<double> scales_;          // [lane][lfo] factor on the depth
  std::vector<double> channel_scales_;  // [channel][lfo] the factor for new notes
  std::vector<double> swings_;          // [parameter] factors or offsets in one voice
};

}  // namespace ressort::engine
