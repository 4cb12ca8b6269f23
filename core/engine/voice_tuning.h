// core/engine: from keys to frequencies to the stiffness factor of a voice.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "core/engine/playing.h"
#include "core/engine/voices.h"

namespace ressort::engine {

// The frequency of every key: the preset's scale, changed by MIDI Tuning Standard messages.
// All functions: [audio] wait-free. A key is 0..127.
class KeyTuning {
 public:
  // `preset_hz` is already transposed by `transpose_semitones`.
  KeyTuning(const KeyFrequencies& preset_hz, double transpose_semitones)
      : preset_hz_(preset_hz), ratio_(std::exp2(transpose_semitones / 12.0)) {
    reset();
  }
  double frequency_hz(std::size_t key) const {
    return retuned_hz_[key] < 0.0 ? preset_hz_[key] : ratio_ * retuned_hz_[key];
  }
  // `frequency_hz` is the frequency before transposition.
  void retune(std::size_t key, double frequency_hz) { retuned_hz_[key] = frequency_hz; }
  void reset() { retuned_hz_.fill(as_preset); }
  void adopt(const KeyTuning& from) { retuned_hz_ = from.retuned_hz_; }

 private:
  static constexpr double as_preset = -1.0;
  KeyFrequencies preset_hz_;
  double ratio_;
  KeyFrequencies retuned_hz_{};
};

// All functions: [audio] wait-free.
class VoiceTuning {
 public:
  VoiceTuning(const Playing& playing, double rate_hz)
      : keys(playing.keys_hz, playing.transpose), playing_(playing), rate_hz_(rate_hz) {}
  void continue_from(const VoiceTuning& from) {
    keys = from.keys;
    parameter_ = from.parameter_;
  }

  // Sets the parameter of Playing::along. Returns whether it has changed.
  bool set_parameter(double value) {
    const bool has_changed = value != parameter_;
    parameter_ = value;
    return has_changed;
  }
  // Returns the frequency of a note: its own, or its key's if `own_hz` is 0.
  double note_hz(int key, double own_hz) const {
    return own_hz > 0.0 ? own_hz : keys.frequency_hz(static_cast<std::size_t>(key));
  }
  // Returns `hz`, or 0 if the frequency is above Nyquist or needs an unstable stiffness on this
  // key.
  double playable_hz(int key, double hz, double highest_factor) const {
    return hz < 0.5 * rate_hz_ && factor_at(key, hz) <= highest_factor ? hz : 0.0;
  }
  // Returns the ratio by which bend, glide and vibrato change a voice's frequency.
  static double bend_of(const Voice& voice, const Channels& channels) {
    return std::exp2(
        (voice.semitones + channels.zone_semitones(voice.channel) + voice.glide + voice.vibrato) /
        12.0);
  }
  // Returns the voice's factor on every stiffness, with `bent` as bend_of().
  double factor_for(const Voice& voice, double bent, double highest_factor) const {
    const double factor = voice.frequency_hz > 0.0
                              ? factor_at(key_of(voice), voice.frequency_hz * bent)
                              : bent * bent;
    return std::min(factor, highest_factor);
  }
  // Returns the voice's factor as it would be at the initial values of all parameters.
  double initial_factor(const Voice& voice) const {
    return (playing_.along.at.empty() && playing_.key_pitches.empty()) || voice.frequency_hz <= 0.0
               ? voice.factor
               : voice.factor * playing_.pitches.factor_at(voice.frequency_hz) /
                     factor_at(key_of(voice), voice.frequency_hz);
  }

  KeyTuning keys;

 private:
  static constexpr int no_key = -1;
  static int key_of(const Voice& voice) { return voice.has_key ? voice.key : no_key; }

  double factor_at(int key, double frequency_hz) const {
    const PitchesAlong& along = playing_.along;
    if (key == no_key || playing_.key_pitches.empty()) {
      return along.at.empty() ? playing_.pitches.factor_at(frequency_hz)
                              : along.factor_at(frequency_hz, parameter_);
    }
    // Beyond the key's table, the intervals of the common one hold.
    const Pitches& own = playing_.key_pitches[static_cast<std::size_t>(key)];
    const double inside_hz = own.inside(frequency_hz);
    const double beyond = inside_hz == frequency_hz ? 1.0
                                                    : playing_.pitches.factor_at(frequency_hz) /
                                                          playing_.pitches.factor_at(inside_hz);
    const double factor = beyond * own.factor_at(inside_hz);
    if (along.at.empty() || parameter_ == along.start) {
      return factor;
    }
    // The key's table holds at the parameter's start.
    const VoiceCurve* const curve = playing_.curve_of(along.parameter);
    const auto on_key = [&](double knob) {
      return along.factor_at(frequency_hz, curve == nullptr ? knob : curve->on_key(key, knob));
    };
    return factor * on_key(parameter_) / on_key(along.start);
  }

  const Playing& playing_;
  double rate_hz_;
  double parameter_ = 0.0;
};

}  // namespace ressort::engine
