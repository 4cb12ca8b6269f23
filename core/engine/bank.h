// core/engine: the kernels' side of an engine. All lanes' states in one precision, and the buffers
// that drive them and that they fill.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/engine/engine.h"
#include "core/engine/program.h"

namespace ressort {

// The kernels' side: all lanes' states in one precision.
template <class T>
struct Bank {
  Bank(const Program& program, std::size_t lanes)
      : drive(max_segment_frames * program.inputs.size()),
        audio(max_segment_frames * program.audio_coefficients.size()),
        outputs(max_segment_frames * program.outputs.size()) {
    // One by one: a copy would not have the room that a State reserves for its ramps.
    const std::size_t count = (lanes + lane_count<T> - 1) / lane_count<T>;
    groups.reserve(count);
    while (groups.size() < count) {
      groups.emplace_back(program);
    }
  }

  std::size_t lanes() const { return groups.size() * lane_count<T>; }

  // Sets one lane's coefficient: at once, or to be reached by the next ramp().
  void set_coefficient(std::size_t lane, std::uint32_t c, double value, bool ramped) {
    State<T>& state = groups[lane / lane_count<T>];
    const std::size_t i = lane % lane_count<T>;
    if (ramped && !state.is_ramping[c]) {
      state.is_ramping[c] = true;
      state.ramping.push_back(c);
      state.target[c] = state.coefficient[c];
    }
    state.target[c][i] = static_cast<T>(value);
    if (!ramped) {
      state.coefficient[c][i] = state.target[c][i];
      state.increment[c][i] = T(0);
    }
  }

  void ramp(std::size_t lane, std::size_t frames) {
    State<T>& state = groups[lane / lane_count<T>];
    state.ramp_frames = state.ramping.empty() ? 0 : frames;
    for (const std::uint32_t c : state.ramping) {
      state.increment[c] = (state.target[c] - state.coefficient[c]) / static_cast<T>(frames);
    }
  }

  std::vector<State<T>> groups;
  std::vector<Drive<T>> drive;    // [frame][input]
  std::vector<Lanes<T>> audio;    // [frame][audio coefficient]
  std::vector<Lanes<T>> outputs;  // [frame][channel]
};

}  // namespace ressort
