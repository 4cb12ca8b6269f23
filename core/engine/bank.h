// core/engine: the kernels of all parts and voices in one precision, with their input and output
// buffers.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/engine/mix.h"
#include "core/kernels/registry.h"
#include "core/kernels/threads/kernel_task.h"
#include "core/progress.h"

namespace ressort::engine {

// The kernels of one part of the machine. Each kernel steps `width` voices.
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
    before.resize(last.size());
    slope.resize(last.size());
    for (std::size_t voice = 0; voice < kernels.size() * width; ++voice) {
      restart_slopes(voice);
    }
  }
  // Sets the positions and velocities before the first sample of a voice, for outputs of
  // derivatives. [audio]
  void restart_slopes(std::size_t voice) {
    for (std::size_t output = 0; output < program.outputs.size(); ++output) {
      const std::uint32_t node = program.outputs[output].node;
      const std::size_t at = voice / width * row() + output * width + voice % width;
      before[at] = static_cast<T>(program.position[node]);
      slope[at] = static_cast<T>(program.velocity[node] / program.rate_ratio);
    }
  }
  T* last_of(std::size_t voice) { return last.data() + voice / width * row(); }
  // size of an output row of one kernel
  std::size_t row() const { return program.outputs.size() * width; }
  Kernel<T>& of(std::size_t voice) { return *kernels[voice / width]; }
  const Kernel<T>& of(std::size_t voice) const { return *kernels[voice / width]; }

  const Program& program;
  std::size_t width = 1;
  std::vector<std::unique_ptr<Kernel<T>>> kernels;  // [voice / width]
  Aligned<T> last;                                  // [kernel][output][lane] last sample
  // The position and the velocity in the last sample, for outputs of derivatives.
  Aligned<T> before;  // [kernel][output][lane]
  Aligned<T> slope;   // [kernel][output][lane]
};

// The kernels of a part that several threads step. Each has its own buffers.
template <class T>
struct SharedPart {
  std::vector<std::unique_ptr<KernelTask<T>>> tasks;  // [kernel]
  std::vector<std::uint32_t> wanted;                  // kernels that step in this block
  double kernel_ns = 0.0;                             // predicted time of a kernel per sample
  std::unique_ptr<Crew> crew;  // declared last, so destroyed first; null: one thread
};

template <class T>
struct Bank : BlockBuffers<T> {
  Bank(const Machine& machine, std::size_t voices_in, Isa isa, Executor* executor,
       const Progress& progress)
      : voices(voices_in),
        mixer(with_isa(isa, []<Isa level>() { return make_mixer<level, T>(); })) {
    std::size_t inputs = 0;
    std::size_t most_inputs = 0;
    std::size_t audio_coefficients = 0;
    std::size_t most_outputs = 0;
    std::size_t lanes = 0;
    std::size_t outputs_of_one = 0;
    std::size_t nodes = 0;
    for (const Program& program : machine.parts) {
      const std::size_t width = parts.emplace_back(program, voices, isa, progress).width;
      inputs = std::max(inputs, width * program.inputs.size());
      most_inputs = std::max(most_inputs, program.inputs.size());
      audio_coefficients = std::max(audio_coefficients, width * program.audio_coefficients.size());
      most_outputs = std::max(most_outputs, width * program.outputs.size());
      lanes = std::max(lanes, width);
      outputs_of_one = std::max(outputs_of_one, program.outputs.size());
      nodes = std::max(nodes, program.position.size());
    }
    this->value.resize(max_block_frames * inputs);
    this->velocity.resize(this->value.size());
    this->audio.resize(max_block_frames * audio_coefficients);
    this->outputs.resize(max_block_frames * most_outputs);
    row.resize(inputs);
    common_row.resize(most_inputs);
    peak.resize(lanes);
    gain.resize(lanes);
    channels.resize(outputs_of_one);
    x.resize(nodes);
    v.resize(nodes);
    for (std::size_t p = 0; p < parts.size(); ++p) {
      shared.push_back(executor != nullptr ? share(p, isa, *executor) : SharedPart<T>());
    }
  }

  // Calls use(part, group) for every kernel.
  template <class Use>
  void each_group(Use&& use) {
    for (std::size_t p = 0; p < parts.size(); ++p) {
      for (std::size_t kernel = 0; kernel < parts[p].kernels.size(); ++kernel) {
        use(parts[p], group_of(p, kernel));
      }
    }
  }

  // Computes one segment. For every kernel it calls drive(part, group), steps the kernel if the
  // result is true, and calls mix(part, group, has_stepped). The kernels of an expensive part are
  // stepped by several threads; voices are independent, so the result has the same bits. Lanes
  // from `end` on sleep.
  template <class Drive, class Mix>
  void step(std::size_t frames, std::size_t end, Drive&& drive, Mix&& mix) {
    awake_end_ = end;
    for (std::size_t p = 0; p < parts.size(); ++p) {
      if (shared[p].crew && shared[p].kernel_ns * static_cast<double>(frames) > least_shared_ns) {
        step_together(p, frames, drive, mix);
        continue;
      }
      for (std::size_t kernel = 0; kernel < parts[p].kernels.size(); ++kernel) {
        const VoiceGroup group = awake_of(p, kernel);
        is_common = false;
        const bool steps = drive(parts[p], group);
        if (steps) {
          parts[p].kernels[kernel]->step({.frames = frames,
                                          .value = this->value.data(),
                                          .velocity = this->velocity.data(),
                                          .is_common = is_common,
                                          .is_still = filled_part == &parts[p],
                                          .audio = this->audio.data(),
                                          .outputs = this->outputs.data(),
                                          .lanes = group.end - group.first});
        }
        mix(parts[p], group, steps);
      }
    }
  }

  // Returns whether a part's kernels accept one input row for all lanes (see is_common).
  bool may_be_common(std::size_t p) const {
    return !shared[p].crew && parts[p].kernels[0]->takes_common_inputs();
  }
  std::size_t lanes_of_rows(const PartBank<T>& part) const { return is_common ? 1 : part.width; }

  static constexpr double least_shared_ns = 5000.0;  // kernel time per block that pays for threads

  std::size_t voices;
  std::vector<PartBank<T>> parts;
  std::vector<SharedPart<T>> shared;  // [part]
  bool is_common = false;             // one input row serves all lanes of the current kernel

  // Drivers at rest give every frame the same row and no velocity. The fields below cache what the
  // buffers hold: the row in `filled_frames` frames of `filled_part`, and leading zero velocities.
  Aligned<T> row;         // [input][lane]
  Aligned<T> common_row;  // [input] if all lanes are equal
  const PartBank<T>* filled_part = nullptr;
  std::size_t filled_frames = 0;
  bool filled_common = false;
  std::size_t zero_velocities = 0;

  Mixer<T> mixer;
  Aligned<T> peak;        // [lane]
  Aligned<T> gain;        // [lane]
  std::vector<double> x;  // [node] positions of a voice that is inspected or taken over
  std::vector<double> v;
  std::vector<double*> channels;  // [output] destination of the mix

 private:
  VoiceGroup group_of(std::size_t p, std::size_t kernel) const {
    const std::size_t first = kernel * parts[p].width;
    return {p, first, std::min(voices, first + parts[p].width)};
  }

  // Returns the lanes of a kernel that may be awake.
  VoiceGroup awake_of(std::size_t p, std::size_t kernel) const {
    VoiceGroup group = group_of(p, kernel);
    group.end = std::max(group.first, std::min(group.end, awake_end_));
    return group;
  }

  SharedPart<T> share(std::size_t p, Isa isa, Executor& executor) {
    PartBank<T>& part = parts[p];
    SharedPart<T> together;
    if (part.kernels.size() < 2) {
      return together;
    }
    typename KernelTask<T>::Make make;
    if (executor.is_live()) {
      make = [&] { return make_kernel<T>(part.program, voices, isa); };
    }
    std::vector<Task*> tasks;
    for (std::unique_ptr<Kernel<T>>& kernel : part.kernels) {
      together.tasks.push_back(std::make_unique<KernelTask<T>>(
          kernel, static_cast<const BlockBuffers<T>&>(*this), make));
      tasks.push_back(together.tasks.back().get());
      if (executor.is_live() && !together.tasks.back()->can_copy()) {
        return {};
      }
    }
    together.kernel_ns = estimated_ns(part.program, {.is_double = std::is_same_v<T, double>,
                                                     .isa = isa,
                                                     .voices = static_cast<int>(part.width)});
    together.wanted.reserve(tasks.size());
    together.crew = executor.gather(std::move(tasks));
    return together;
  }

  template <class Drive, class Mix>
  void step_together(std::size_t p, std::size_t frames, Drive&& drive, Mix&& mix) {
    SharedPart<T>& together = shared[p];
    const auto with_buffers_of = [&](KernelTask<T>& task, auto&& use) {
      std::swap(static_cast<BlockBuffers<T>&>(*this), task.buffers);
      use();
      std::swap(static_cast<BlockBuffers<T>&>(*this), task.buffers);
    };
    together.wanted.clear();
    for (std::uint32_t kernel = 0; kernel < together.tasks.size(); ++kernel) {
      KernelTask<T>& task = *together.tasks[kernel];
      clear_cache();
      with_buffers_of(task, [&] {
        const VoiceGroup group = awake_of(p, kernel);
        if (drive(parts[p], group)) {
          task.frames = frames;
          task.lanes = group.end - group.first;
          task.is_still = filled_part == &parts[p];
          together.wanted.push_back(kernel);
        }
      });
    }
    clear_cache();
    together.crew->run(together.wanted);
    auto next = together.wanted.begin();
    for (std::uint32_t kernel = 0; kernel < together.tasks.size(); ++kernel) {
      const bool has_stepped = next != together.wanted.end() && *next == kernel;
      next += has_stepped ? 1 : 0;
      with_buffers_of(*together.tasks[kernel],
                      [&] { mix(parts[p], awake_of(p, kernel), has_stepped); });
    }
  }

  void clear_cache() {
    filled_part = nullptr;
    zero_velocities = 0;
  }

  std::size_t awake_end_ = 0;
};

}  // namespace ressort::engine
