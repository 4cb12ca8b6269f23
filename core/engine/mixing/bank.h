// core/engine: the kernels' side of an engine. Every part's kernels in one precision, and the
// buffers that drive them and that they fill.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/engine/mixing/mix.h"
#include "core/kernels/domains/kernel_task.h"
#include "core/kernels/domains/sharded_form.h"
#include "core/kernels/registry.h"
#include "core/progress.h"

namespace ressort::engine {

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

// The kernels of a part that several threads step. Each has buffers of its own.
template <class T>
struct SharedPart {
  std::vector<std::unique_ptr<KernelTask<T>>> tasks;  // [kernel]
  std::vector<std::uint32_t> wanted;                  // kernels that step in this block
  double kernel_ns = 0.0;                             // a sample of one of them
  std::unique_ptr<Crew> crew;                         // the last: it ends first; null: one thread
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
    std::size_t channels = 0;
    std::size_t lanes = 0;
    std::size_t outputs_of_one = 0;
    std::size_t nodes = 0;
    for (const Program& program : machine.parts) {
      const std::size_t width = parts.emplace_back(program, voices, isa, progress).width;
      inputs = std::max(inputs, width * program.inputs.size());
      most_inputs = std::max(most_inputs, program.inputs.size());
      audio_coefficients = std::max(audio_coefficients, width * program.audio_coefficients.size());
      channels = std::max(channels, width * program.outputs.size());
      lanes = std::max(lanes, width);
      outputs_of_one = std::max(outputs_of_one, program.outputs.size());
      nodes = std::max(nodes, program.position.size());
    }
    this->value.resize(max_block_frames * inputs);
    this->velocity.resize(this->value.size());
    this->audio.resize(max_block_frames * audio_coefficients);
    this->outputs.resize(max_block_frames * channels);
    row.resize(inputs);
    common_row.resize(most_inputs);
    peak.resize(lanes);
    gain.resize(lanes);
    heard.resize(outputs_of_one);
    x.resize(nodes);
    v.resize(nodes);
    for (std::size_t p = 0; p < parts.size(); ++p) {
      shared.push_back(executor != nullptr ? share(p, isa, *executor) : SharedPart<T>());
    }
  }

  // Calls `use(part, group)` for every kernel.
  template <class Use>
  void each_group(Use&& use) {
    for (std::size_t p = 0; p < parts.size(); ++p) {
      for (std::size_t kernel = 0; kernel < parts[p].kernels.size(); ++kernel) {
        use(parts[p], group_of(p, kernel));
      }
    }
  }

  // Calls drive(part, group) for every kernel, steps those for which it says so, and calls
  // mix(part, group, whether it has stepped): one after the other, or where a part takes long all
  // of it at once. Voices do not hear each other, so that this comes to the same bits. Those from
  // `end` on sleep.
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
                                          .audio = this->audio.data(),
                                          .outputs = this->outputs.data(),
                                          .lanes = group.end - group.first});
        }
        mix(parts[p], group, steps);
      }
    }
  }

  // Whether one row may be for all lanes of a kernel; it is where `is_common` says so.
  bool may_be_common(std::size_t p) const {
    return !shared[p].crew && parts[p].kernels[0]->takes_common_inputs();
  }
  std::size_t lanes_of_rows(const PartBank<T>& part) const { return is_common ? 1 : part.width; }

  static constexpr double least_shared_ns = 5000.0;  // of a kernel in a block

  std::size_t voices;
  std::vector<PartBank<T>> parts;
  std::vector<SharedPart<T>> shared;  // [part]
  // The buffers are as Block says; each part in turn, or each kernel that brings its own.
  bool is_common = false;

  // Drivers that rest give every frame the same row, [input][lane], and no velocity. Of what the
  // buffers hold, it is in so many frames of `filled_part`, and so many velocities are 0.
  Aligned<T> row;
  Aligned<T> common_row;  // [input] the same of one lane, which is that of all
  const PartBank<T>* filled_part = nullptr;
  std::size_t filled_frames = 0;
  bool filled_common = false;
  std::size_t still = 0;

  Mixer<T> mixer;
  Aligned<T> peak;        // [lane]
  Aligned<T> gain;        // [lane]
  std::vector<double> x;  // [node] of a voice that is looked at, or taken over
  std::vector<double> v;
  std::vector<double*> heard;  // [output] where it is to be added

 private:
  VoiceGroup group_of(std::size_t p, std::size_t kernel) const {
    const std::size_t first = kernel * parts[p].width;
    return {p, first, std::min(voices, first + parts[p].width)};
  }

  // Those that may be awake.
  VoiceGroup awake_of(std::size_t p, std::size_t kernel) const {
    VoiceGroup group = group_of(p, kernel);
    group.end = std::max(group.first, std::min(group.end, awake_end_));
    return group;
  }

  SharedPart<T> share(std::size_t p, Isa isa, Executor& executor) {
    PartBank<T>& part = parts[p];
    SharedPart<T> together;
    if (part.kernels.size() < 2 || part.program.form.template is<kernels::Shards>()) {
      return together;
    }
    typename KernelTask<T>::Make make;
    if (executor.is_live()) {
      make = [&] { return make_kernel<T>(part.program, voices, isa); };
    }
    std::vector<Task*> tasks;
    for (std::unique_ptr<Kernel<T>>& kernel : part.kernels) {
      together.tasks.push_back(std::make_unique<KernelTask<T>>(
          kernel, static_cast<const BlockBuffers<T>&>(*this), HaloBuffers<T>(), make));
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
      forget_filled();
      with_buffers_of(task, [&] {
        const VoiceGroup group = awake_of(p, kernel);
        if (drive(parts[p], group)) {
          task.frames = frames;
          task.lanes = group.end - group.first;
          together.wanted.push_back(kernel);
        }
      });
    }
    forget_filled();
    together.crew->run(together.wanted);
    auto next = together.wanted.begin();
    for (std::uint32_t kernel = 0; kernel < together.tasks.size(); ++kernel) {
      const bool has_stepped = next != together.wanted.end() && *next == kernel;
      next += has_stepped ? 1 : 0;
      with_buffers_of(*together.tasks[kernel],
                      [&] { mix(parts[p], awake_of(p, kernel), has_stepped); });
    }
  }

  void forget_filled() {
    filled_part = nullptr;
    still = 0;
  }

  std::size_t awake_end_ = 0;
};

}  // namespace ressort::engine
