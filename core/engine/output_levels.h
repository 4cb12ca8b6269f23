// core/engine: the derivatives and the level formulas of the model's outputs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/engine/bank.h"
#include "core/engine/voices.h"

namespace ressort::engine {

// Replaces the positions of a kernel that has stepped by velocities or accelerations, where an
// output asks for them: differences of successive samples, in units per sample at the reference
// rate. [audio] wait-free
template <class T>
void differentiate(Bank<T>& bank, const VoiceGroup& group, std::size_t frames);

// All functions but the constructor: [audio] wait-free, O(outputs that have a level).
class OutputLevels {
 public:
  OutputLevels(const Machine& machine, const Playing& playing);
  void continue_from(const OutputLevels& from) { parts_ = from.parts_; }

  // Computes the levels for new parameter values. Levels ramp linearly; they jump if `at_once` is
  // true, and in the bare network.
  void follow(const Machine& machine, std::span<const double> parameters, bool at_once);
  // Multiplies the outputs of a kernel that has stepped.
  template <class T>
  void apply(Bank<T>& bank, const VoiceGroup& group, std::size_t frames) const;
  // Advances the ramps after all kernels have stepped.
  void advance(std::size_t frames);

 private:
  struct Level {
    std::uint32_t output = 0;  // output of the part
    double now = 1.0;
    double step = 0.0;  // per frame of the ramp
    double target = 1.0;
    std::size_t frames = 0;  // frames left of the ramp
    double after(std::size_t n) const {
      return n < frames ? now + step * static_cast<double>(n) : target;
    }
  };
  std::vector<std::vector<Level>> parts_;  // [part] outputs with a level
  std::size_t ramp_frames_;
};

}  // namespace ressort::engine
