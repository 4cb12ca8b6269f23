// How each voice is tuned.
#include <algorithm>
#include <cmath>

#include "core/engine/voices.h"
#include "core/kernels/kernel.h"

namespace ressort::engine {

double Voices::pitch_hz(int key, double own_hz) const {
  return own_hz > 0.0 ? own_hz : tuning_.frequency_hz(static_cast<std::size_t>(key));
}

// The pitch of a voice that sounds becomes this one, unless it is that already.
void Voices::move_to(Voice& voice, int key, double own_hz, bool glides, double highest_factor) {
  const double key_hz = pitch_hz(key, own_hz);
  const double hz = playable_hz(key_hz, highest_factor);
  voice.has_own_pitch = own_hz > 0.0;
  if (key_hz == voice.key_hz || hz == 0.0) {
    return;
  }
  const double before_hz = voice.frequency_hz * std::exp2(voice.glide / 12.0);
  voice.key_hz = key_hz;
  voice.frequency_hz = hz;
  voice.glide = 0.0;
  voice.is_retuned = has_changed_ = true;
  if (glides) {
    glide_from(voice, before_hz);
  }
  if (!playing_.keys_db.empty()) {
    follow_level(voice);
  }
  last_hz_[voice.channel % Channels::count] = voice.frequency_hz;
}

void Voices::glide_from(Voice& voice, double frequency_hz) {
  const double seconds = channels_.glide_s(voice.channel, playing_.glide_s);
  if (seconds <= 0.0 || playing_.bare) {
    return;
  }
  const double steps = std::max(1.0, seconds * rate_hz_ / static_cast<double>(max_block_frames));
  voice.glide = 12.0 * std::log2(frequency_hz / voice.frequency_hz);
  voice.glide_step = std::fabs(voice.glide) / steps;
}

void Voices::glide_on() {
  for (Voice& voice : voices_) {
    if (voice.awake && voice.glide != 0.0) {
      const double left = std::max(0.0, std::fabs(voice.glide) - voice.glide_step);
      voice.glide = std::copysign(left, voice.glide);
      voice.is_retuned = has_changed_ = true;
    }
  }
}

void Voices::retune(std::uint8_t channel) {
  // What is said to one member may be for all of them, such as the range of bends.
  const ChannelMask zone = channels_.reach(channels_.master_of(channel));
  for (Voice& voice : voices_) {
    if (!voice.awake || !is_on(voice, zone)) {
      continue;
    }
    const bool follows = hears(voice, {.channels = channel_bit(voice.channel)});
    const double semitones = follows ? channels_.semitones(voice.channel) : voice.semitones;
    if (semitones != voice.semitones || is_on(voice, channels_.reach(channel))) {
      voice.semitones = semitones;
      voice.is_retuned = has_changed_ = true;
    }
  }
}

void Voices::retune_key(std::size_t key, double frequency_hz, bool is_now, double highest_factor) {
  tuning_.retune(key, frequency_hz);
  for (Voice& voice : voices_) {
    if (is_now && voice.awake && voice.has_key && voice.key == key && !voice.has_own_pitch &&
        voice.frequency_hz > 0.0 && frequency_hz > 0.0) {
      move_to(voice, static_cast<int>(key), 0.0, false, highest_factor);
    }
  }
}

void Voices::reset_tuning(double highest_factor) {
  tuning_.reset();
  for (Voice& voice : voices_) {
    if (voice.awake && voice.has_key && !voice.has_own_pitch && voice.frequency_hz > 0.0 &&
        tuning_.frequency_hz(voice.key) > 0.0) {
      move_to(voice, voice.key, 0.0, false, highest_factor);
    }
  }
}

double Voices::factor_at(double frequency_hz) const {
  return playing_.along.at.empty() ? playing_.pitches.factor_at(frequency_hz)
                                   : playing_.along.factor_at(frequency_hz, tuned_at_);
}

void Voices::tune_at(double value) {
  if (value == tuned_at_) {
    return;
  }
  tuned_at_ = value;
  for (Voice& voice : voices_) {
    voice.is_retuned |= voice.awake;
  }
  has_changed_ = true;
}

double Voices::first_factor(const Voice& voice) const {
  return playing_.along.at.empty() || voice.frequency_hz <= 0.0
             ? voice.factor
             : voice.factor * playing_.pitches.factor_at(voice.frequency_hz) /
                   factor_at(voice.frequency_hz);
}

// 0 where it cannot be played.
double Voices::playable_hz(double hz, double highest_factor) const {
  return hz < 0.5 * rate_hz_ && factor_at(hz) <= highest_factor ? hz : 0.0;
}

double Voices::factor_for(const Voice& voice, double highest_factor) const {
  const double bent =
      std::exp2((voice.semitones + channels_.zone_semitones(voice.channel) + voice.glide) / 12.0);
  const double factor =
      voice.frequency_hz > 0.0 ? factor_at(voice.frequency_hz * bent) : bent * bent;
  return std::min(factor, highest_factor);
}

double Voices::factor_of(std::size_t lane, double highest_factor) const {
  const Voice& voice = voices_[lane];
  return voice.is_new || voice.is_retuned ? factor_for(voice, highest_factor) : voice.factor;
}

void Voices::retune(bool all, double highest_factor) {
  for (Voice& voice : voices_) {
    if (voice.awake && (all || voice.is_new || voice.is_retuned)) {
      const double factor = factor_for(voice, highest_factor);
      voice.is_retuned |= factor != voice.factor;
      voice.factor = factor;
    }
  }
}

void Voices::forget_changes() {
  for (Voice& voice : voices_) {
    voice.is_new = voice.is_retuned = false;
  }
  has_changed_ = false;
}

}  // namespace ressort::engine
