#include "core/engine/audio_inputs.h"

#include <algorithm>
#include <bit>

namespace ressort::engine {

AudioInputs::AudioInputs(const Machine& machine, const Playing& playing, IsSilent is_silent)
    : is_silent_(is_silent), bare_(playing.bare), inputs_(machine.inputs.size()) {
  for (const Control& control : playing.controls) {
    if (control.source == Source::audio) {
      const ModelInput& input = machine.inputs[control.target];
      const double r = input.is_force ? machine.rate_ratio : 1.0;
      inputs_[control.target] = {.control = &control,
                                 .scale = control.settings.high * r * r,
                                 .before = playing.bare ? input.position : 0.0};
    }
  }
}

void AudioInputs::continue_from(const AudioInputs& from) {
  for (std::size_t input = 0; input < inputs_.size(); ++input) {
    inputs_[input].before = from.inputs_[input].before;
  }
}

const double* AudioInputs::channel_of(const Driven& input, const Segment& segment) {
  return input.control != nullptr && input.control->number < segment.inputs.size()
             ? segment.inputs[input.control->number]
             : nullptr;
}

bool AudioInputs::find_sound(const Segment& segment) {
  bool any = false;
  for (Driven& input : inputs_) {
    input.samples = nullptr;
    if (const double* const channel = channel_of(input, segment)) {
      const bool sounds =
          channel[segment.at] != 0.0 || !is_silent_(channel + segment.at, segment.frames);
      any |= sounds;
      if (sounds || input.before != 0.0 || bare_) {
        input.samples = channel + segment.at;
      }
    }
  }
  return any;
}

void AudioInputs::keep_last_samples(const Segment& segment) {
  for (Driven& input : inputs_) {
    if (const double* const channel = channel_of(input, segment)) {
      input.before = input.scale * channel[segment.end() - 1];
    }
  }
}

// Returns how many inputs of a part from `first` on can be added in one pass: audio drives all of
// them, and they are all positions or all forces. The result is 0 or a power of 2.
std::size_t AudioInputs::count_adjacent(const Program& program, std::size_t first,
                                        std::size_t most) const {
  const auto is_alike = [&](std::size_t i) {
    const InputSlot& slot = program.inputs[i];
    return inputs_[slot.input].samples != nullptr &&
           slot.is_force == program.inputs[first].is_force;
  };
  std::size_t count = 0;
  while (count < most && first + count < program.inputs.size() && is_alike(first + count)) {
    ++count;
  }
  return std::bit_floor(count);
}

bool AudioInputs::drives_all(const Program& program) const {
  return !program.inputs.empty() &&
         std::all_of(program.inputs.begin(), program.inputs.end(),
                     [&](const InputSlot& slot) { return drives(slot.input); });
}

template <class T>
void AudioInputs::add(Bank<T>& bank, const VoiceGroup& group, std::size_t frames, bool at_rest,
                      const Voices& voices, EnergyWatch& watch) const {
  const PartBank<T>& part = bank.parts[group.part];
  const std::size_t width = bank.lanes_of_rows(part);
  const std::size_t most = width == 1 ? AudioInput<T>::most : 1;
  std::size_t next = 0;
  for (std::size_t i = 0; i < part.program.inputs.size(); i = next) {
    const std::size_t count = count_adjacent(part.program, i, most);
    next = i + std::max<std::size_t>(1, count);
    if (count == 0) {
      continue;
    }
    for (std::size_t lane = group.first; lane < group.end; ++lane) {
      watch.mark_driven(voices[lane], lane, group.part);
    }
    bank.held->filled_part = nullptr;
    AudioInput<T> added;
    added.count = count;
    added.frames = frames;
    added.rests = at_rest || bare_;
    added.value = bank.block->value.data() + i * width;
    added.velocity = nullptr;
    added.step = part.program.inputs.size() * width;
    added.width = width;
    for (std::size_t sound = 0; sound < count; ++sound) {
      const Driven& input = inputs_[part.program.inputs[i + sound].input];
      added.samples[sound] = input.samples;
      added.scale[sound] = input.scale;
      added.before[sound] = input.before;
      added.rest[sound] = bare_ ? T(0) : bank.held->row[(i + sound) * part.width];
    }
    if (!part.program.inputs[i].is_force) {
      bank.held->zero_velocities = 0;
      added.velocity = bank.block->velocity.data() + i * width;
    }
    bank.mixer.add_audio(added);
  }
}

template void AudioInputs::add(Bank<float>&, const VoiceGroup&, std::size_t, bool, const Voices&,
                               EnergyWatch&) const;
template void AudioInputs::add(Bank<double>&, const VoiceGroup&, std::size_t, bool, const Voices&,
                               EnergyWatch&) const;

}  // namespace ressort::engine
