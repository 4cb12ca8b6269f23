// core/engine: what the outputs of the model are multiplied by before they are mixed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/engine/mixing/bank.h"
#include "core/engine/voices.h"

namespace ressort::engine {

// All functions but the constructor: [audio] wait-free, O(outputs that have a level).
class OutputLevels {
 public:
  OutputLevels(const Machine& machine, const Playing& playing);
  void go_on_from(const OutputLevels& from) { parts_ = from.parts_; }

  // Parameters have these values from here on: levels move there in a straight line, or at once
  // where nothing sounds yet, and in a bare network.
  void follow(const Machine& machine, std::span<const double> parameters, bool at_once);
  // A kernel has stepped: what it says is multiplied.
  template <class T>
  void apply(Bank<T>& bank, const VoiceGroup& group, std::size_t frames) const;
  // All kernels have.
  void advance(std::size_t frames);

 private:
  struct Level {
    std::uint32_t output = 0;  // of the part
    double now = 1.0;
    double step = 0.0;  // in a frame, as long as `frames` are left
    double target = 1.0;
    std::size_t frames = 0;
    double after(std::size_t n) const {
      return n < frames ? now + step * static_cast<double>(n) : target;
    }
  };
  std::vector<std::vector<Level>> parts_;  // [part] those that have one
  std::size_t ramp_frames_;
};

}  // namespace ressort::engine
