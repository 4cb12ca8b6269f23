// core/engine: audio channels that drive inputs of the model.
#pragma once

#include <cstddef>
#include <vector>

#include "core/engine/bank.h"
#include "core/engine/energy_watch.h"

namespace ressort::engine {

// All functions but the constructor: [audio] wait-free.
class AudioInputs {
 public:
  AudioInputs(const Machine& machine, const Playing& playing, IsSilent is_silent);
  void continue_from(const AudioInputs& from);

  // Prepares a segment. Returns whether any channel carries sound.
  bool find_sound(const Segment& segment);
  // Keeps the last samples of a segment, for the velocity in the first sample of the next one.
  void keep_last_samples(const Segment& segment);

  bool drives(std::size_t input) const { return inputs_[input].samples != nullptr; }
  bool drives_all(const Program& program) const;
  // Adds the audio to the drivers' positions; in the bare network it replaces them. If audio drives
  // all inputs and the drivers are `at_rest` at the same positions in every lane, the buffers need
  // not be filled before.
  template <class T>
  void add(Bank<T>& bank, const VoiceGroup& group, std::size_t frames, bool at_rest,
           const Voices& voices, EnergyWatch& watch) const;

 private:
  struct Driven {
    const Control* control = nullptr;  // null: no audio drives the input
    double scale = 1.0;
    double before = 0.0;              // last scaled sample
    const double* samples = nullptr;  // samples of this segment; null: silent
  };
  std::size_t count_adjacent(const Program& program, std::size_t first, std::size_t most) const;
  static const double* channel_of(const Driven& input, const Segment& segment);

  IsSilent is_silent_;
  bool bare_;
  std::vector<Driven> inputs_;  // [input]
};

}  // namespace ressort::engine
