// core/engine: the kernels' side of an engine. Every part's kernels in one precision, and the
// buffers that drive them and that they fill.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/engine/mixing/mix.h"
#include "core/kernels/kernel.h"
#include "core/progress.h"

namespace ressort {

// One part of the machine, in as many voices as are wanted.
template <class T>
struct PartBank {
  PartBank(const Program& program_in, std::size_t voices, Isa isa, const Progress& progress)
      : program(program_in) {
    do {
      progress.spend(4 * program.position.size() + program.ends.size());
      kernels.push_back(make_kernel<T>(program, voices, isa));
      width = kernels[0]->width();
    } while (kernels.size() * width < voices);
    last.resize(kernels.size() * row());
  }
  T* last_of(std::size_t voice) { return last.data() + voice / width * row(); }
  std::size_t row() const { return program.outputs.size() * width; }  // of one kernel
  Kernel<T>& of(std::size_t voice) { return *kernels[voice / width]; }
  const Kernel<T>& of(std::size_t voice) const { return *kernels[voice / width]; }

  const Program& program;
  std::size_t width = 1;
  std::vector<std::unique_ptr<Kernel<T>>> kernels;  // [voice / width]
  Aligned<T> last;                                  // [kernel][output][lane] the last sample's
};

template <class T>
struct Bank {
  Bank(const Machine& machine, std::size_t voices_in, Isa isa, const Progress& progress)
      : voices(voices_in),
        mixer(with_isa(isa, []<Isa level>() { return make_mixer<level, T>(); })) {
    std::size_t inputs = 0;
    std::size_t audio_coefficients = 0;
    std::size_t channels = 0;
    std::size_t lanes = 0;
    std::size_t outputs_of_one = 0;
    std::size_t nodes = 0;
    for (const Program& program : machine.parts) {
      const std::size_t width = parts.emplace_back(program, voices, isa, progress).width;
      inputs = std::max(inputs, width * program.inputs.size());
      audio_coefficients = std::max(audio_coefficients, width * program.audio_coefficients.size());
      channels = std::max(channels, width * program.outputs.size());
      lanes = std::max(lanes, width);
      outputs_of_one = std::max(outputs_of_one, program.outputs.size());
      nodes = std::max(nodes, program.position.size());
    }
    value.resize(max_block_frames * inputs);
    velocity.resize(value.size());
    audio.resize(max_block_frames * audio_coefficients);
    outputs.resize(max_block_frames * channels);
    row.resize(inputs);
    filled.resize(inputs);
    peak.resize(lanes);
    gain.resize(lanes);
    heard.resize(outputs_of_one);
    x.resize(nodes);
    v.resize(nodes);
  }

  // Calls `use(part, group)` for every kernel.
  template <class Use>
  void each_group(Use&& use) {
    for (std::size_t p = 0; p < parts.size(); ++p) {
      for (std::size_t first = 0; first < voices; first += parts[p].width) {
        use(parts[p], VoiceGroup{p, first, std::min(voices, first + parts[p].width)});
      }
    }
  }

  std::size_t voices;
  std::vector<PartBank<T>> parts;
  // As Block says; each part in turn.
  Aligned<T> value;
  Aligned<T> velocity;
  Aligned<T> audio;
  Aligned<T> outputs;

  // Drivers that rest give every frame the same row, [input][lane], and no velocity. Of what the
  // buffers hold, `filled` is in so many frames of `filled_part`, and so many velocities are 0.
  Aligned<T> row;
  Aligned<T> filled;
  const PartBank<T>* filled_part = nullptr;
  std::size_t filled_frames = 0;
  std::size_t still = 0;

  Mixer<T> mixer;
  Aligned<T> peak;        // [lane]
  Aligned<double> gain;   // [lane]
  std::vector<double> x;  // [node] of a voice that is looked at, or taken over
  std::vector<double> v;
  std::vector<double*> heard;  // [output] where it is to be added
};

}  // namespace ressort
