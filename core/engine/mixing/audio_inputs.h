// core/engine: sound that comes in and moves inputs of the model.
#pragma once

#include <cstddef>
#include <vector>

#include "core/engine/energy_watch.h"
#include "core/engine/mixing/bank.h"

namespace ressort::engine {

// All functions but the constructor: [audio] wait-free.
class AudioInputs {
 public:
  AudioInputs(const Machine& machine, const Playing& playing, IsSilent is_silent);
  void go_on_from(const AudioInputs& from);

  // Before a segment: whether some sound comes in. Silence after silence is not looked at again.
  bool listen(const Segment& segment);
  // After a segment: where it ended is needed for the velocity of the next one's first sample.
  void remember(const Segment& segment);

  bool moves(std::size_t input) const { return inputs_[input].samples != nullptr; }
  bool move_all(const Program& program) const;
  // On top of where the drivers are; in the bare network instead of that. Where sound moves all
  // inputs, and drivers rest in the same place in every lane, the buffers need not be filled.
  template <class T>
  void add(Bank<T>& bank, const VoiceGroup& group, std::size_t frames, bool rests,
           const Voices& voices, EnergyWatch& watch) const;

 private:
  struct Driven {
    const Control* control = nullptr;  // null where no audio drives the input
    double scale = 1.0;
    double before = 0.0;              // the last scaled sample
    const double* samples = nullptr;  // of this segment; null where all is silent
  };
  std::size_t side_by_side(const Program& program, std::size_t first, std::size_t most) const;
  static const double* channel_of(const Driven& input, const Segment& segment);

  IsSilent is_silent_;
  bool bare_;
  std::vector<Driven> inputs_;  // [input]
};

}  // namespace ressort::engine
