#include "core/engine/mixing/mixing.h"

#include <algorithm>
#include <cmath>

namespace ressort::engine {

Mixing::Mixing(const Playing& playing)
    : gain_(playing.gain),
      loudest_(playing.bare ? runaway : std::min(runaway, runaway_level / playing.gain)) {}

template <class T>
void Mixing::add(Bank<T>& bank, const VoiceGroup& group, const Segment& segment, Voices& voices,
                 EnergyWatch& watch) const {
  PartBank<T>& part = bank.parts[group.part];
  const std::size_t count = part.program.outputs.size();
  const std::size_t width = part.width;
  constexpr std::size_t pack = 64 / sizeof(T);  // the widest
  const std::size_t used = group.end - group.first;
  const Heard<T> heard{.outputs = bank.outputs.data(),
                       .frames = segment.frames,
                       .count = count,
                       .width = width,
                       .lanes = std::min(width, (used + pack - 1) / pack * pack)};
  const auto is_heard = [&](std::size_t lane) {
    return voices[lane].awake && !watch.is_still(lane, group.part);
  };
  bool is_any_lost = false;
  bool are_all_steady = true;
  std::fill_n(bank.gain.begin(), heard.lanes, T(0));
  for (std::size_t lane = group.first; lane < group.end; ++lane) {
    const Voice& voice = voices[lane];
    is_any_lost |= voice.lost;
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
    bank.heard[output] = segment.outputs[part.program.outputs[output].channel] + segment.at;
  }
  const bool is_mixed =
      bank.mixer.mix(heard, loudest_, bank.gain.data(), bank.heard.data(), bank.peak.data());
  for (std::size_t lane = group.first; lane < group.end; ++lane) {
    if (!is_heard(lane)) {
      continue;
    }
    Voice& voice = voices[lane];
    const auto peak = static_cast<double>(bank.peak[lane - group.first]);
    const auto sample = [&](std::size_t n, std::size_t output) {
      return static_cast<double>(bank.outputs[(n * count + output) * width + lane - group.first]);
    };
    if (!(peak < loudest_)) {
      const std::size_t sane = sane_frames(segment.frames, count, sample);
      add_one(part.program, voice, segment, 0, sane, sample);
      watch.lose(part,
                 sane > 0 ? bank.outputs.data() + (sane - 1) * part.row() : part.last_of(lane),
                 lane, group.part, voices);
      add_held(part.program, voice, segment, sane, watch.held(lane, group.part));
      bank.gain[lane - group.first] = T(0);
      is_any_lost = true;
      continue;
    }
    voice.peak = std::max(voice.peak, peak);
    if (!are_all_steady && !voice.is_steady()) {
      add_one(part.program, voice, segment, 0, segment.frames, sample);
    }
  }
  if (!is_mixed) {
    bank.mixer.add_voices(heard, bank.gain.data(), bank.heard.data());
  }
  keep_last(bank, group, segment.frames, is_any_lost, voices, watch);
  clear_wide_registers();
}

// What has left its bounds is no last sample: the next voice in that lane might stand still on it.
template <class T>
void Mixing::keep_last(Bank<T>& bank, const VoiceGroup& group, std::size_t frames, bool is_any_lost,
                       const Voices& voices, const EnergyWatch& watch) {
  PartBank<T>& part = bank.parts[group.part];
  T* const last = part.last_of(group.first);
  std::copy_n(bank.outputs.data() + (frames - 1) * part.row(), part.row(), last);
  for (std::size_t lane = group.first; is_any_lost && lane < group.end; ++lane) {
    for (std::size_t output = 0; voices[lane].lost && output < part.program.outputs.size();
         ++output) {
      last[output * part.width + lane - group.first] =
          static_cast<T>(watch.held(lane, group.part)[output]);
    }
  }
}

// How many frames there are before one that is beyond what any output reaches.
template <class Sample>
std::size_t Mixing::sane_frames(std::size_t frames, std::size_t outputs, Sample&& sample) const {
  for (std::size_t n = 0; n < frames; ++n) {
    for (std::size_t output = 0; output < outputs; ++output) {
      if (!(std::fabs(sample(n, output)) < loudest_)) {
        return n;
      }
    }
  }
  return frames;
}

// One voice by itself: its `sample(n, output)` in frames [from, to) of the segment.
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

void Mixing::add_held(const Program& program, const Voice& voice, const Segment& segment,
                      std::size_t from, const double* held) const {
  add_one(program, voice, segment, from, segment.frames,
          [&](std::size_t, std::size_t output) { return held[output]; });
}

void Mixing::add_still(const Program& program, const VoiceGroup& group, const Segment& segment,
                       const Voices& voices, const EnergyWatch& watch) const {
  for (std::size_t lane = group.first; lane < group.end; ++lane) {
    const double* const held = watch.held(lane, group.part);
    if (voices[lane].awake && watch.is_still(lane, group.part) &&
        std::any_of(held, held + program.outputs.size(), [](double y) { return y != 0.0; })) {
      add_held(program, voices[lane], segment, 0, held);
    }
  }
}

// Uniform in -1..1: xorshift, from a fixed seed so that a render repeats.
void Mixing::make_noise(const Segment& segment) {
  for (std::size_t n = segment.at; n < segment.end(); ++n) {
    for (double* const output : segment.outputs) {
      noise_ ^= noise_ << 13;
      noise_ ^= noise_ >> 7;
      noise_ ^= noise_ << 17;
      output[n] *= static_cast<double>(static_cast<std::int64_t>(noise_)) * 0x1p-63;
    }
  }
}

template void Mixing::add(Bank<float>&, const VoiceGroup&, const Segment&, Voices&,
                          EnergyWatch&) const;
template void Mixing::add(Bank<double>&, const VoiceGroup&, const Segment&, Voices&,
                          EnergyWatch&) const;

}  // namespace ressort::engine
