#include "core/engine/keyboard.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/engine/event.h"
#include "core/kernels/kernel.h"

namespace ressort::engine {
namespace {

constexpr double replaced_s = 0.2;     // T60 of a voice whose key is struck again on another voice
constexpr double release_range = 4.0;  // ratio of T60 at release velocity 0 or 1 to that at 0.5

bool is_on(const Voice& voice, ChannelMask channels) {
  return has_channel(channels, voice.channel);
}

// Returns a voice's frequency, without bend, at this point of its glide.
double gliding_hz(const Voice& voice) {
  return voice.frequency_hz * std::exp2(voice.glide / 12.0);
}

}  // namespace

Keyboard::Keyboard(const Playing& playing, double rate_hz, std::size_t outputs)
    : voices(playing, rate_hz),
      playing_(playing),
      rate_hz_(rate_hz),
      rings_on_(std::none_of(playing.controls.begin(), playing.controls.end(),
                             [](const Control& control) {
                               return control.source == Source::note &&
                                      row_of(control.gesture).release != nullptr;
                             })),
      is_stereo_(outputs > 1),
      channels_(static_cast<std::uint8_t>(std::countr_zero(playing.channels) %
                                          static_cast<int>(midi_channel_count))),
      tuning_(playing, rate_hz) {}

void Keyboard::continue_from(const Keyboard& from) {
  voices.continue_from(from.voices);
  channels_ = from.channels_;
  tuning_.continue_from(from.tuning_);
  held_keys_ = from.held_keys_;
  last_hz_ = from.last_hz_;
  turns_ = from.turns_;
}

void Keyboard::adopt_channels(const Keyboard& from) {
  channels_.adopt(from.channels_);
  tuning_.keys.adopt(from.tuning_.keys);
  for (std::uint8_t channel = 0; channel < Channels::count; ++channel) {
    retune(channel);
    for_each_reached(channel, [&](Voice& voice) {
      voices.ramp_volume(voice, level_of(voice));
      damp(voice);
    });
  }
}

// The output of each voice stays continuous: the volume starts at the old gain and ramps.
void Keyboard::renumber(double gain_ratio) {
  for (Voice& voice : voices) {
    if (!voice.awake) {
      continue;
    }
    voices.mark_retuned(voice);
    if (gain_ratio != 1.0) {
      for (double& volume : voice.volume) {
        volume *= gain_ratio;
      }
      voices.ramp_volume(voice, level_of(voice));
    }
  }
}

// --- keys ---------------------------------------------------------------------------------------

bool Keyboard::wake(std::size_t lane) {
  const bool starts = !voices[lane].awake;
  if (starts) {
    voices.start(lane, voices[lane].frequency_hz, channels_.semitones(0));
  }
  voices[lane].quiet_frames = 0;
  return starts;
}

Press Keyboard::press_key(int key, double velocity, std::uint8_t channel, double highest_factor,
                          double own_hz) {
  // Fixed tuning has one instrument and one voice; a key only excites it.
  const bool is_fixed = playing_.tuning == Tuning::fixed;
  const double note_hz = is_fixed ? 0.0 : tuning_.note_hz(key, own_hz);
  const double hz = is_fixed ? 0.0 : tuning_.playable_hz(key, note_hz, highest_factor);
  if (!is_fixed && hz == 0.0) {
    return Press::silent;
  }
  HeldKeys& held = held_keys_[channel % Channels::count];
  const bool is_struck = held.is_empty() || !is_legato(channel);
  const bool glides = !held.is_empty() || !is_legato(channel);
  held.press(key, velocity, own_hz);
  Voice* const mono = !is_fixed && is_mono(channel) ? latest_on(channel) : nullptr;
  const bool sounds_on = mono != nullptr && (is_struck ? !rings_on_ && mono->is_undamped()
                                                       : mono->is_undamped() || mono->held);
  if (sounds_on) {
    voices.set_latest(*mono);
    attach(*mono, key, channel, is_struck);
    replace_other_keys(key, channel);
    move_to(*mono, key, own_hz, glides, highest_factor);
    return is_struck ? Press::strikes : Press::moves;
  }
  if (mono != nullptr) {
    last_hz_[channel % Channels::count] = gliding_hz(*mono);
    replace_other_keys(key, channel);
  }
  Voice* const kept = is_fixed ? nullptr : replace_voices_of(key, channel, velocity);
  if (kept != nullptr && !rings_on_) {
    voices.set_latest(*kept);
    attach(*kept, key, channel, false);
    return Press::moves;
  }
  Voice& latest = voices[voices.latest()];
  const bool stays = is_fixed && !latest.fading && latest.is_undamped();
  Voice& voice = stays ? latest : voices.take_lane();
  voices.set_latest(voice);
  if (is_fixed && voice.is_live()) {
    attach(voice, key, channel, true);
    return Press::strikes;
  }
  start_voice(key, channel, {.hz = hz, .key_hz = note_hz, .is_own = own_hz > 0.0}, glides);
  if (kept != nullptr && kept != &voice) {
    voices.compare(voice, *kept);
  }
  return Press::starts;
}

// Starts a voice in the latest lane. It glides from the last pitch of its channel if `glides`.
void Keyboard::start_voice(int key, std::uint8_t channel, const Pitch& pitch, bool glides) {
  Voice& voice = voices[voices.latest()];
  voices.start(voices.latest(), pitch.hz, channels_.semitones(0));
  voice.key_hz = pitch.key_hz;
  voice.has_own_pitch = pitch.is_own;
  attach(voice, key, channel, true);
  voice.volume = level_of(voice);
  double& before_hz = last_hz_[channel % Channels::count];
  if (glides && before_hz > 0.0 && pitch.hz > 0.0) {
    glide_from(voice, before_hz);
  }
  before_hz = pitch.hz;
}

// From now on the voice is held by this key of this channel. `is_struck`: the key also strikes it.
void Keyboard::attach(Voice& voice, int key, std::uint8_t channel, bool is_struck) {
  voice.has_key = true;
  voice.key = static_cast<std::uint8_t>(key);
  voice.struck_key = is_struck ? voice.key : voice.struck_key;
  if (!playing_.curves.empty()) {
    voices.mark_retuned(voice);
  }
  voice.channel = channel;
  voice.turn = ++turns_;
  hold(voice);
  voice.quiet_frames = 0;
  if (voice.semitones != channels_.semitones(channel)) {
    voice.semitones = channels_.semitones(channel);
    voices.mark_retuned(voice);
  }
}

// Lifts the damper of a voice whose key goes down.
void Keyboard::hold(Voice& voice) const {
  voice.held = true;
  voice.sustained = voice.latched = voice.is_released = false;
  damp(voice);
}

Voice* Keyboard::latest_on(std::uint8_t channel) {
  return voices.least_of(
      [&](const Voice& voice) {
        return voice.is_live() && voice.has_key && voice.channel == channel;
      },
      [](const Voice& a, const Voice& b) { return a.turn > b.turn; });
}

std::optional<ReturnedKey> Keyboard::return_to_held_key(int key, std::uint8_t channel,
                                                        double highest_factor) {
  HeldKeys& held = held_keys_[channel % Channels::count];
  held.release(key);
  Voice* const voice = latest_on(channel);
  const std::optional<HeldKey> earlier = held.last();
  if (playing_.tuning == Tuning::fixed || !is_mono(channel) || !earlier || voice == nullptr ||
      !voice->held || voice->key != key) {
    return std::nullopt;
  }
  const bool is_struck = !is_legato(channel);
  const double key_hz = tuning_.note_hz(earlier->key, earlier->frequency_hz);
  const double hz = tuning_.playable_hz(earlier->key, key_hz, highest_factor);
  if (is_struck && rings_on_ && hz > 0.0) {
    last_hz_[channel % Channels::count] = gliding_hz(*voice);
    replace_other_keys(earlier->key, channel);
    voices.set_latest(voices.take_lane());
    start_voice(earlier->key, channel,
                {.hz = hz, .key_hz = key_hz, .is_own = earlier->frequency_hz > 0.0}, true);
    return ReturnedKey{*earlier, Press::starts};
  }
  voices.set_latest(*voice);
  attach(*voice, earlier->key, channel, is_struck);
  replace_other_keys(earlier->key, channel);
  move_to(*voice, earlier->key, earlier->frequency_hz, true, highest_factor);
  return ReturnedKey{*earlier, is_struck ? Press::strikes : Press::moves};
}

bool Keyboard::release_key(Voice& voice, int key, std::uint8_t channel, double velocity) const {
  if (!voice.held || voice.key != key || voice.channel != channel) {
    return false;
  }
  voice.held = false;
  voice.is_released = true;
  voice.release_velocity = velocity;
  voice.release_s = playing_.damper_on(voice.key) *
                    std::pow(release_range, 2.0 * (usual_release_velocity - velocity));
  voice.sustained = voice.latched || channels_.sustains(channel);
  damp(voice);
  return !voice.sustained;
}

void Keyboard::release(Voice& voice) const {
  voice.held = voice.sustained = voice.latched = false;
  damp(voice);
}

// Damps a voice whose key, or whose mono channel, another voice plays from now on.
void Keyboard::replace(Voice& voice) const {
  voice.held = voice.sustained = voice.latched = false;
  voice.is_released = voice.is_replaced = true;
  const bool is_damped = voice.decay.kept_goal < 1.0;
  voice.release_s = is_damped ? std::min(voice.release_s, replaced_s) : replaced_s;
  damp(voice);
}

// Damps all voices of a mono channel that have another key than this one. A released voice keeps
// its decay, but no pedal lifts its damper again. The new key is struck on a voice of its own: if
// it retuned the sounding network within 3 ms, the energy would grow with the stiffness, and a
// second hammer would be thrown while its gap is still closing.
void Keyboard::replace_other_keys(int key, std::uint8_t channel) {
  for (Voice& voice : voices) {
    if (!voice.is_live() || !voice.has_key || voice.channel != channel || voice.key == key) {
      continue;
    }
    if (voice.is_undamped() || voice.decay.kept_goal == 1.0) {
      replace(voice);
    } else {
      voice.is_replaced = true;
      damp(voice);
    }
  }
}

// A repeated key damps its earlier voices, as a finger or hammer touches the same string. But a
// softer strike must not silence a string that rings: the loudest voice rings on beside the new
// one, and both end with the key. A voice that is bowed or held ends, because its key begins a new
// stroke. If a pedal holds it, it goes on alone. A new voice has a new hammer: a second blow on one
// that has flown away would add to its speed. Returns the voice that rings on, or null.
Voice* Keyboard::replace_voices_of(int key, std::uint8_t channel, double velocity) {
  const auto is_earlier = [&](const Voice& voice) {
    return voice.is_live() && voice.has_key && !voice.is_replaced && voice.key == key &&
           voice.channel == channel;
  };
  const auto may_ring_on = [&](const Voice& voice) {
    return (rings_on_ || voice.sustained) && is_earlier(voice) && voice.velocity > velocity &&
           voice.level > quiet_level;
  };
  Voice* const kept = voices.least_of(
      may_ring_on, [](const Voice& a, const Voice& b) { return a.level > b.level; });
  for (Voice& voice : voices) {
    if (&voice == kept) {
      hold(voice);
    } else if (is_earlier(voice)) {
      replace(voice);
    }
  }
  return kept;
}

void Keyboard::invert(Voice& voice) const {
  constexpr double ramp_s = 0.006;  // both cancel until then
  voice.strength = -voice.strength;
  voices.ramp_volume(voice, level_of(voice), ramp_s);
}

void Keyboard::damp_keyless(Voice& voice) const {
  voice.is_released = true;
  damp(voice);
}

// Sets the damper by the voice's key and pedals.
void Keyboard::damp(Voice& voice) const {
  const double damper_s = playing_.damper_on(voice.has_key ? voice.key : middle_c);
  const bool may_lie = voice.is_released && !voice.latched && damper_s > 0.0;
  const double share = voice.is_replaced ? 1.0 : may_lie ? channels_.damper(voice.channel) : 0.0;
  voices.damp(voice, share);
}

void Keyboard::forget_keys(ChannelMask channels) {
  for (unsigned channel = 0; channel < held_keys_.size(); ++channel) {
    if (has_channel(channels, channel)) {
      held_keys_[channel].clear();
      last_hz_[channel] = 0.0;
    }
  }
}

void Keyboard::panic() {
  for (Voice& voice : voices) {
    if (voice.awake) {
      voices.fade(voice);
    }
  }
  channels_.lift_pedals();
  forget_keys(all_channels);
}

void Keyboard::silence(std::uint8_t channel) {
  for_each_reached(channel, [&](Voice& voice) { voices.fade(voice); });
}

// --- channels -----------------------------------------------------------------------------------

template <class Use>
void Keyboard::for_each_reached(std::uint8_t channel, Use&& use) {
  const ChannelMask reached = channels_.reach(channel);
  for (Voice& voice : voices) {
    if (voice.awake && is_on(voice, reached)) {
      use(voice);
    }
  }
}

Channels::Change Keyboard::turn_controller(std::uint8_t channel, int number, double value) {
  const bool was_latching = channels_.latches(channel);
  const ChannelMask reached = channels_.reach(channel);
  const Channels::Change change = channels_.turn(channel, number, value);
  switch (change) {
    case Channels::Change::pitch:
      retune(channel);
      break;
    case Channels::Change::level:
      for_each_reached(channel, [&](Voice& voice) { voices.ramp_volume(voice, level_of(voice)); });
      break;
    case Channels::Change::sostenuto:
      for (Voice& voice : voices) {
        if (is_on(voice, reached) && channels_.latches(channel) != was_latching) {
          voice.latched = !was_latching && voice.held;
        }
      }
      for_each_reached(channel, [&](Voice& voice) { damp(voice); });
      break;
    case Channels::Change::zones:
    case Channels::Change::sustain:
      for_each_reached(channel, [&](Voice& voice) { damp(voice); });
      break;
    case Channels::Change::modulation:
    case Channels::Change::nothing:
      break;
  }
  return change;
}

void Keyboard::bend(std::uint8_t channel, double amount) {
  channels_.bend(channel, std::clamp(amount, -1.0, 1.0));
  retune(channel);
}

void Keyboard::reset_controllers(std::uint8_t channel) {
  channels_.reset(channel);
  const ChannelMask reached = channels_.reach(channel);
  for (Voice& voice : voices) {
    voice.latched &= !is_on(voice, reached);
  }
  retune(channel);
  for_each_reached(channel, [&](Voice& voice) {
    voices.ramp_volume(voice, level_of(voice));
    damp(voice);
  });
}

bool Keyboard::is_released_by_pedal(const Voice& voice, std::uint8_t channel) const {
  return voice.sustained && is_on(voice, channels_.reach(channel)) && !voice.latched &&
         !channels_.sustains(voice.channel);
}

SideGains Keyboard::level_of(const Voice& voice) const {
  double level = channels_.level(voice.channel) * voice.tremolo;
  if (voice.has_key && !playing_.keys_db.empty()) {
    level *= std::pow(10.0, value_at(playing_.keys_db, voice.key) / 20.0);
  }
  const SideGains balance = is_stereo_ ? channels_.balance(voice.channel) : SideGains{1.0, 1.0};
  return {level * balance[0], level * balance[1]};
}

void Keyboard::set_velocity(Voice& voice, double velocity) {
  voice.velocity = velocity;
  if (!playing_.curves.empty()) {
    voices.mark_retuned(voice);
  }
}

void Keyboard::vibrate(Voice& voice, double semitones, double gain) {
  if (voice.vibrato != semitones) {
    voice.vibrato = semitones;
    voices.mark_retuned(voice);
  }
  if (voice.tremolo != gain) {
    voice.tremolo = gain;
    if (voice.is_new && voice.volume_frames == 0) {
      set_strength(voice, voice.strength);
    } else {
      voices.follow_volume(voice, level_of(voice));
    }
  }
}

void Keyboard::set_strength(Voice& voice, double strength, double rise_s) const {
  voice.strength = strength;
  const SideGains level = level_of(voice);
  if (voice.is_new && rise_s > 0.0) {
    voice.volume = {0.0, 0.0};
    voices.ramp_volume(voice, level, rise_s);
  } else if (voice.is_new) {
    voice.volume = {strength * level[0], strength * level[1]};
    voice.volume_frames = 0;
  } else {
    voices.ramp_volume(voice, level);
  }
}

// --- addressing ---------------------------------------------------------------------------------

// Such a scope includes voices without a key. A message to a member of an MPE zone is for that
// member's note only. With fixed tuning there is one instrument, and every message addresses it.
bool Keyboard::is_for_all(const Scope& scope) const {
  return playing_.tuning == Tuning::fixed ||
         (scope.key == Scope::every_key && (scope.channels & ~channels_.members()) != 0);
}

bool Keyboard::is_addressed(const Voice& voice, const Scope& scope) const {
  if (!voice.awake || !voice.has_key || playing_.tuning == Tuning::fixed) {
    return voice.awake && is_for_all(scope);
  }
  const bool was_released = channels_.is_member(voice.channel) && !voice.held && !voice.sustained;
  const std::uint8_t by = was_released ? channels_.master_of(voice.channel) : voice.channel;
  return has_channel(scope.channels, by) && (scope.key < 0 || scope.key == voice.key);
}

std::optional<std::size_t> Keyboard::latest_of(const Scope& scope) const {
  const Voice& latest = voices[voices.latest()];
  if (is_addressed(latest, scope) || (!latest.awake && is_for_all(scope))) {
    return voices.latest();
  }
  std::optional<std::size_t> found;
  for (std::size_t lane = 0; lane < voices.size(); ++lane) {
    if (voices[lane].is_live() && is_addressed(voices[lane], scope) &&
        (!found || voices[lane].turn > voices[*found].turn)) {
      found = lane;
    }
  }
  return found;
}

// --- tuning -------------------------------------------------------------------------------------

// Moves a sounding voice to another pitch.
void Keyboard::move_to(Voice& voice, int key, double own_hz, bool glides, double highest_factor) {
  const double key_hz = tuning_.note_hz(key, own_hz);
  const double hz = tuning_.playable_hz(key, key_hz, highest_factor);
  voice.has_own_pitch = own_hz > 0.0;
  if (key_hz == voice.key_hz || hz == 0.0) {
    return;
  }
  const double before_hz = gliding_hz(voice);
  voice.key_hz = key_hz;
  voice.frequency_hz = hz;
  voice.glide = 0.0;
  voices.mark_retuned(voice);
  if (glides) {
    glide_from(voice, before_hz);
  }
  if (!playing_.keys_db.empty()) {
    voices.ramp_volume(voice, level_of(voice));
  }
  last_hz_[voice.channel % Channels::count] = voice.frequency_hz;
}

void Keyboard::glide_from(Voice& voice, double frequency_hz) const {
  const double seconds = channels_.glide_s(voice.channel, playing_.glide_s);
  if (seconds <= 0.0 || playing_.bare) {
    return;
  }
  const double steps = std::max(1.0, seconds * rate_hz_ / static_cast<double>(max_block_frames));
  voice.glide = 12.0 * std::log2(frequency_hz / voice.frequency_hz);
  voice.glide_step = std::fabs(voice.glide) / steps;
}

void Keyboard::retune(std::uint8_t channel) {
  // A message to one member, such as a bend range, may change the whole zone.
  const ChannelMask zone = channels_.reach(channels_.master_of(channel));
  for (Voice& voice : voices) {
    if (!voice.awake || !is_on(voice, zone)) {
      continue;
    }
    const bool follows = is_addressed(voice, {.channels = channel_bit(voice.channel)});
    const double semitones = follows ? channels_.semitones(voice.channel) : voice.semitones;
    if (semitones != voice.semitones || is_on(voice, channels_.reach(channel))) {
      voice.semitones = semitones;
      voices.mark_retuned(voice);
    }
  }
}

void Keyboard::retune_key(std::size_t key, double frequency_hz, bool is_now,
                          double highest_factor) {
  tuning_.keys.retune(key, frequency_hz);
  for (Voice& voice : voices) {
    if (is_now && voice.awake && voice.has_key && voice.key == key && !voice.has_own_pitch &&
        voice.frequency_hz > 0.0 && frequency_hz > 0.0) {
      move_to(voice, static_cast<int>(key), 0.0, false, highest_factor);
    }
  }
}

void Keyboard::reset_tuning(double highest_factor) {
  tuning_.keys.reset();
  for (Voice& voice : voices) {
    if (voice.awake && voice.has_key && !voice.has_own_pitch && voice.frequency_hz > 0.0 &&
        tuning_.keys.frequency_hz(voice.key) > 0.0) {
      move_to(voice, voice.key, 0.0, false, highest_factor);
    }
  }
}

void Keyboard::set_tuning_parameter(double value) {
  if (tuning_.set_parameter(value)) {
    for (Voice& voice : voices) {
      if (voice.awake) {
        voices.mark_retuned(voice);
      }
    }
  }
}

double Keyboard::factor_of(const Voice& voice, double highest_factor) const {
  return voice.is_new || voice.is_retuned
             ? tuning_.factor_for(voice, VoiceTuning::bend_of(voice, channels_), highest_factor)
             : voice.factor;
}

void Keyboard::update_factors(bool all, double highest_factor) {
  for (Voice& voice : voices) {
    if (voice.awake && (all || voice.is_new || voice.is_retuned)) {
      const double bent = VoiceTuning::bend_of(voice, channels_);
      const double factor = tuning_.factor_for(voice, bent, highest_factor);
      voice.is_retuned |= factor != voice.factor;
      voice.factor = factor;
      voice.sounding_hz = voice.frequency_hz * bent;
    }
  }
}

}  // namespace ressort::engine
