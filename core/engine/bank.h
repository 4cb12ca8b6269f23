// core/engine: the kernels of all parts and voices in one precision, with their input and output
// buffers.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "core/engine/mix.h"
#include "core/kernels/registry.h"
#include "core/kernels/threads/kernel_task.h"
#include "core/progress.h"

namespace ressort::engine {

// The kernels of one part of the machine. Each kernel steps `width` voices.
template <class T>
struct PartBank {
  PartBank(const Program& program_in, std::span<const double> parameters, std::size_t voices,
           Isa isa, const Progress& progress)
      : program(program_in) {
    do {
      progress.spend(4 * program.position.size() + program.ends.size());
      kernels.push_back(make_kernel<T>(program, voices, isa));
      width = kernels[0]->width();
    } while (kernels.size() * width < voices);
    is_stale.resize(program.coefficients.size());
    for (std::size_t voice = 0; voice < kernels.size() * width; ++voice) {
      evaluated_from.insert(evaluated_from.end(), parameters.begin(), parameters.end());
      for (const Coefficient& coefficient : program.coefficients) {
        untuned.push_back(voice == 0 ? untuned_value(program, coefficient, parameters)
                                     : untuned[untuned.size() - program.coefficients.size()]);
      }
    }
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
  // Evaluates the coefficients of a voice that depend on parameters that have changed. [audio]
  void evaluate(std::size_t voice, std::span<const double> parameters) {
    double* const from = evaluated_from.data() + voice * parameters.size();
    bool has_changed = false;
    for (std::size_t i = 0; i < parameters.size(); ++i) {
      if (std::exchange(from[i], parameters[i]) != parameters[i]) {
        for (const std::uint32_t c : program.depending[i]) {
          has_changed = is_stale[c] = true;
        }
      }
    }
    for (std::uint32_t c = 0; has_changed && c < program.coefficients.size(); ++c) {
      if (is_stale[c]) {
        untuned[voice * program.coefficients.size() + c] =
            untuned_value(program, program.coefficients[c], parameters);
        is_stale[c] = false;
      }
    }
  }
  // Returns the value of a coefficient in a voice for the parameters that were evaluated. [audio]
  double value(std::size_t voice, std::uint32_t c, std::span<const double> parameters,
               double stiffness_factor) const {
    const Coefficient& coefficient = program.coefficients[c];
    if (coefficient.mode != no_mode && !program.form.is_continuous()) {
      return sampled_value(program, coefficient, parameters, stiffness_factor);
    }
    return tuned_value(program, coefficient, untuned[voice * program.coefficients.size() + c],
                       stiffness_factor);
  }
  T* last_of(std::size_t voice) { return last.data() + voice / width * row(); }
  // size of an output row of one kernel
  std::size_t row() const { return program.outputs.size() * width; }
  Kernel<T>& of(std::size_t voice) { return *kernels[voice / width]; }
  const Kernel<T>& of(std::size_t voice) const { return *kernels[voice / width]; }

  const Program& program;
  std::size_t width = 1;
  std::vector<std::unique_ptr<Kernel<T>>> kernels;  // [voice / width]
  std::vector<double> untuned;  // [voice][coefficient] before the stiffness factor (untuned_value)
  std::vector<double> evaluated_from;  // [voice][parameter] values that gave `untuned`
  std::vector<bool> is_stale;          // [coefficient] has to be evaluated
  Aligned<T> last;                     // [kernel][output][lane] last sample
  // The position and the velocity in the last sample, for outputs of derivatives.
  Aligned<T> before;  // [kernel][output][lane]
  Aligned<T> slope;   // [kernel][output][lane]
};

// The content of input buffers. Drivers at rest give every frame the same row and no velocity, and
// the buffers keep both from block to block.
template <class T>
struct HeldInputs {
  Aligned<T> row;                            // [input][lane]
  Aligned<T> common_row;                     // [input] if all lanes are equal
  const PartBank<T>* filled_part = nullptr;  // has the row in its first `filled_frames` frames
  std::size_t filled_frames = 0;
  bool filled_common = false;
  std::size_t zero_velocities = 0;  // leading ones
};

// The kernels of all parts, when several threads step them. Each has its own buffers, so that
// inputs at rest stay in the cache of the thread that reads them.
template <class T>
struct SharedKernels {
  std::vector<std::unique_ptr<KernelTask<T>>> tasks;  // [part][kernel]
  std::vector<HeldInputs<T>> held;                    // [task]
  std::vector<std::uint32_t> wanted;                  // tasks of this block
  std::vector<double> kernel_ns;  // [part] predicted time of a kernel per sample
  std::unique_ptr<Crew> crew;     // declared last, so destroyed first; null: one thread
};

template <class T>
struct Bank {
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
      const std::size_t width =
          parts.emplace_back(program, machine.parameters, voices, isa, progress).width;
      inputs = std::max(inputs, width * program.inputs.size());
      most_inputs = std::max(most_inputs, program.inputs.size());
      audio_coefficients = std::max(audio_coefficients, width * program.audio_coefficients.size());
      most_outputs = std::max(most_outputs, width * program.outputs.size());
      lanes = std::max(lanes, width);
      outputs_of_one = std::max(outputs_of_one, program.outputs.size());
      nodes = std::max(nodes, program.position.size());
    }
    own_block_.value.resize(max_block_frames * inputs);
    own_block_.velocity.resize(own_block_.value.size());
    own_block_.audio.resize(max_block_frames * audio_coefficients);
    own_block_.outputs.resize(max_block_frames * most_outputs);
    own_held_.row.resize(inputs);
    own_held_.common_row.resize(most_inputs);
    peak.resize(lanes);
    gain.resize(lanes);
    factors.resize(rows_together * most_outputs);
    channels.resize(outputs_of_one);
    x.resize(nodes);
    v.resize(nodes);
    std::size_t kernels = 0;
    each_group([&](PartBank<T>&, const VoiceGroup&) { ++kernels; });
    if (executor != nullptr && kernels > 1) {
      share(isa, *executor);
    }
  }

  Bank(const Bank&) = delete;
  Bank& operator=(const Bank&) = delete;

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
  // result is true, and calls mix(part, group, has_stepped). Several threads step the kernels if
  // that takes long enough; voices are independent, so the result has the same bits. Lanes from
  // `end` on sleep.
  template <class Drive, class Mix>
  void step(std::size_t frames, std::size_t end, Drive&& drive, Mix&& mix) {
    awake_end_ = end;
    is_shared_ = shared.crew && awake_ns() * static_cast<double>(frames) > least_shared_ns;
    if (is_shared_) {
      step_together(frames, drive, mix);
      return;
    }
    for (std::size_t p = 0; p < parts.size(); ++p) {
      for (std::size_t kernel = 0; kernel < parts[p].kernels.size(); ++kernel) {
        const VoiceGroup group = awake_of(p, kernel);
        is_common = false;
        const bool steps = drive(parts[p], group);
        if (steps) {
          parts[p].kernels[kernel]->step({.frames = frames,
                                          .value = block->value.data(),
                                          .velocity = block->velocity.data(),
                                          .is_common = is_common,
                                          .is_still = held->filled_part == &parts[p],
                                          .audio = block->audio.data(),
                                          .outputs = block->outputs.data(),
                                          .lanes = group.end - group.first});
        }
        mix(parts[p], group, steps);
      }
    }
  }

  // Returns whether a part's kernels accept one input row for all lanes (see is_common).
  bool may_be_common(std::size_t p) const {
    return !is_shared_ && parts[p].kernels[0]->takes_common_inputs();
  }
  std::size_t lanes_of_rows(const PartBank<T>& part) const { return is_common ? 1 : part.width; }

  // Predicted time of the kernels in a segment that pays for threads.
  static constexpr double least_shared_ns = 20'000.0;

  std::size_t voices;
  std::vector<PartBank<T>> parts;
  SharedKernels<T> shared;
  bool is_common = false;  // one input row serves all lanes of the current kernel

  BlockBuffers<T>* block = &own_block_;  // of the current kernel
  HeldInputs<T>* held = &own_held_;      // in `block`

  Mixer<T> mixer;
  Aligned<T> peak;        // [lane]
  Aligned<T> gain;        // [lane]
  Aligned<T> factors;     // [row of rows_together][output][lane] levels of the outputs
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

  // Returns the predicted time per sample of all kernels with lanes that may be awake.
  double awake_ns() const {
    double ns = 0.0;
    for (std::size_t p = 0; p < parts.size(); ++p) {
      const std::size_t kernels = (awake_end_ + parts[p].width - 1) / parts[p].width;
      ns += shared.kernel_ns[p] * static_cast<double>(kernels);
    }
    return ns;
  }

  void share(Isa isa, Executor& executor) {
    std::vector<Task*> tasks;
    for (PartBank<T>& part : parts) {
      typename KernelTask<T>::Make make;
      if (executor.is_live()) {
        make = [&] { return make_kernel<T>(part.program, voices, isa); };
      }
      for (std::unique_ptr<Kernel<T>>& kernel : part.kernels) {
        shared.tasks.push_back(std::make_unique<KernelTask<T>>(kernel, own_block_, make));
        tasks.push_back(shared.tasks.back().get());
        if (executor.is_live() && !shared.tasks.back()->can_copy()) {
          shared = {};
          return;
        }
      }
      shared.kernel_ns.push_back(
          estimated_ns(part.program, {.is_double = std::is_same_v<T, double>,
                                      .isa = isa,
                                      .voices = static_cast<int>(part.width)}));
    }
    shared.held.resize(tasks.size(), own_held_);
    shared.wanted.reserve(tasks.size());
    shared.crew = executor.gather(std::move(tasks));
  }

  template <class Drive, class Mix>
  void step_together(std::size_t frames, Drive&& drive, Mix&& mix) {
    // Calls use(task, part, group) for every kernel, with the buffers of its task.
    const auto each_task = [&](auto&& use) {
      std::uint32_t task = 0;
      for (std::size_t p = 0; p < parts.size(); ++p) {
        for (std::size_t kernel = 0; kernel < parts[p].kernels.size(); ++kernel, ++task) {
          block = &shared.tasks[task]->buffers;
          held = &shared.held[task];
          use(task, parts[p], awake_of(p, kernel));
        }
      }
      block = &own_block_;
      held = &own_held_;
    };
    shared.wanted.clear();
    is_common = false;
    each_task([&](std::uint32_t i, PartBank<T>& part, const VoiceGroup& group) {
      if (drive(part, group)) {
        KernelTask<T>& task = *shared.tasks[i];
        task.frames = frames;
        task.lanes = group.end - group.first;
        task.is_still = held->filled_part == &part;
        shared.wanted.push_back(i);
        shared.crew->offer(i);
      }
    });
    auto next = shared.wanted.begin();
    each_task([&](std::uint32_t i, PartBank<T>& part, const VoiceGroup& group) {
      const bool has_stepped = next != shared.wanted.end() && *next == i;
      if (has_stepped) {
        ++next;
        shared.crew->finish(i);
      }
      mix(part, group, has_stepped);
    });
  }

  BlockBuffers<T> own_block_;
  HeldInputs<T> own_held_;
  bool is_shared_ = false;  // several threads step this segment
  std::size_t awake_end_ = 0;
};

}  // namespace ressort::engine
