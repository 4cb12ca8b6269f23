#include "core/engine/mixing.h"

#include <algorithm>
#include <cmath>

#include "core/random.h"

namespace ressort::engine {
Mixing::Mixing(const Playing& playing)
    : gain_(playing.gain),
      bound_(playing.bare
                 ? runaway
                 : std::min(runaway, runaway_level / (playing.gain * playing.mean_body_gain))) {}

template <class T>
void Mixing::add(Bank<T>& bank, const VoiceGroup& group, const Segment& segment, Voices& voices,
                 EnergyWatch& watch, Comparison& comparison) {
  PartBank<T>& part = bank.parts[group.part];
  const std::size_t count = part.program.outputs.size();
  const std::size_t width = part.width;
  constexpr std::size_t pack = widest_bytes / sizeof(T);
  const std::size_t used = group.end - group.first;
  const Heard<T> heard{.outputs = bank.block->outputs.data(),
                       .frames = segment.frames,
                       .count = count,
                       .width = width,
                       .lanes = std::min(width, (used + pack - 1) / pack * pack)};
  const auto is_heard = [&](std::size_t lane) {
    return voices[lane].awake && !watch.is_frozen(lane, group.part);
  };
  bool is_any_unstable = false;
  bool are_all_steady = true;
  std::fill_n(bank.gain.begin(), heard.lanes, T(0));
  for (std::size_t lane = group.first; lane < group.end; ++lane) {
    const Voice& voice = voices[lane];
    is_any_unstable |= voice.unstable;
    if (!is_heard(lane)) {
      continue;
    }
    if (voice.is_steady()) {
      bank.gain[lane - group.first] = static_cast<T>(gain_ * voice.decay.gain * voice.volume[0]);
    } else {
      are_all_steady = false;
    }
  }
  for (std::size_t output = 0; output < count; ++output) {
    bank.channels[output] = segment.outputs[part.program.outputs[output].channel] + segment.at;
  }
  const bool is_mixed =
      bank.mixer.mix(heard, bound_, bank.gain.data(), bank.channels.data(), bank.peak.data());
  for (std::size_t lane = group.first; lane < group.end; ++lane) {
    if (!is_heard(lane)) {
      continue;
    }
    Voice& voice = voices[lane];
    const auto peak = static_cast<double>(bank.peak[lane - group.first]);
    const auto sample = [&](std::size_t n, std::size_t output) {
      return static_cast<double>(
          bank.block->outputs[(n * count + output) * width + lane - group.first]);
    };
    if (!(peak < bound_)) {
      const std::size_t sane = count_sane_frames(segment.frames, count, sample);
      add_one(part.program, voice, segment, 0, sane, sample);
      watch.freeze_unstable(
          part,
          sane > 0 ? bank.block->outputs.data() + (sane - 1) * part.row() : part.last_of(lane),
          lane, group.part, voices);
      add_constant(part.program, voice, segment, sane, watch.frozen_outputs(lane, group.part));
      bank.gain[lane - group.first] = T(0);
      is_any_unstable = true;
      continue;
    }
    voice.peak = std::max(voice.peak, peak);
    if (comparison.is_needed(voices)) {
      comparison.keep(lane, segment.frames, count, width,
                      bank.block->outputs.data() + lane - group.first);
    }
    if (!are_all_steady && !voice.is_steady()) {
      add_one(part.program, voice, segment, 0, segment.frames, sample);
    }
  }
  if (!is_mixed) {
    bank.mixer.add_voices(heard, bank.gain.data(), bank.channels.data());
  }
  keep_last(bank, group, segment.frames, is_any_unstable, voices, watch);
  clear_wide_registers();
}

// Keeps the last sample of each lane. An unstable voice keeps its last sane sample instead, because
// the next voice in that lane might be frozen at it.
template <class T>
void Mixing::keep_last(Bank<T>& bank, const VoiceGroup& group, std::size_t frames,
                       bool is_any_unstable, const Voices& voices, const EnergyWatch& watch) {
  PartBank<T>& part = bank.parts[group.part];
  T* const last = part.last_of(group.first);
  std::copy_n(bank.block->outputs.data() + (frames - 1) * part.row(), part.row(), last);
  for (std::size_t lane = group.first; is_any_unstable && lane < group.end; ++lane) {
    for (std::size_t output = 0; voices[lane].unstable && output < part.program.outputs.size();
         ++output) {
      last[output * part.width + lane - group.first] =
          static_cast<T>(watch.frozen_outputs(lane, group.part)[output]);
    }
  }
}

// Returns the number of frames before the first one out of bounds.
template <class Sample>
std::size_t Mixing::count_sane_frames(std::size_t frames, std::size_t outputs,
                                      Sample&& sample) const {
  for (std::size_t n = 0; n < frames; ++n) {
    for (std::size_t output = 0; output < outputs; ++output) {
      if (!(std::fabs(sample(n, output)) < bound_)) {
        return n;
      }
    }
  }
  return frames;
}

// Mixes one voice with changing gains: sample(n, output) in frames [from, to) of the segment.
template <class Sample>
void Mixing::add_one(const Program& program, const Voice& voice, const Segment& segment,
                     std::size_t from, std::size_t to, Sample&& sample) const {
  Decay decay = voice.decay;
  SideGains volume = voice.volume;
  for (std::size_t n = 0; n < to; ++n) {
    decay.advance();
    for (std::size_t side = 0; side < volume.size() && n < voice.volume_frames; ++side) {
      volume[side] += voice.volume_step[side];
    }
    for (std::size_t output = 0; n >= from && output < program.outputs.size(); ++output) {
      const std::size_t channel = program.outputs[output].channel;
      segment.outputs[channel][segment.at + n] +=
          gain_ * decay.gain * volume[channel % volume.size()] * sample(n, output);
    }
  }
}

void Mixing::add_constant(const Program& program, const Voice& voice, const Segment& segment,
                          std::size_t from, const double* outputs) const {
  add_one(program, voice, segment, from, segment.frames,
          [&](std::size_t, std::size_t output) { return outputs[output]; });
}

void Mixing::add_frozen(const Program& program, const VoiceGroup& group, const Segment& segment,
                        const Voices& voices, const EnergyWatch& watch) const {
  for (std::size_t lane = group.first; lane < group.end; ++lane) {
    const double* const outputs = watch.frozen_outputs(lane, group.part);
    if (voices[lane].awake && watch.is_frozen(lane, group.part) &&
        std::any_of(outputs, outputs + program.outputs.size(), [](double y) { return y != 0.0; })) {
      add_constant(program, voices[lane], segment, 0, outputs);
    }
  }
}

// The seed is fixed, so renders repeat.
void Mixing::make_noise(const Segment& segment, MakeNoise make, bool is_silent) {
  const std::size_t count = segment.outputs.size();
  for (std::size_t c = 0; c < count && !is_silent; ++c) {
    make(segment.outputs[c] + segment.at, segment.frames, noise_ + c * splitmix_step, count);
  }
  noise_ += count * segment.frames * splitmix_step;
}

template void Mixing::add(Bank<float>&, const VoiceGroup&, const Segment&, Voices&, EnergyWatch&,
                          Comparison&);
template void Mixing::add(Bank<double>&, const VoiceGroup&, const Segment&, Voices&, EnergyWatch&,
                          Comparison&);

}  // namespace ressort::engine
