#include "core/engine/voices.h"

#include <bit>
#include <cmath>
#include <numbers>

#include "core/kernels/kernel.h"

namespace ressort::engine {
namespace {

constexpr double steal_fade_s = 0.005;  // a voice that gives way takes this long to vanish
constexpr double level_memory_s = 0.1;  // how long a voice's level remembers a peak
constexpr double quiet_s = 0.5;         // longer than half a period of the slowest sound
constexpr double level_s = 0.02;        // in which a voice follows its channel's level
constexpr double damper_on_s = 0.005;   // the time constant with which a damper comes on
constexpr double damped_away = 1e-6;    // of the gain: nothing is heard any more
constexpr double replaced_s = 0.2;      // T60 of what rings by a key that is pressed again
constexpr double release_reach = 4.0;   // by which a key of velocity 0 or 1 is slower or faster

// Who gives way first: whose key is up, then who is quieter.
bool is_heard_less(const Voice& a, const Voice& b) {
  const bool a_is_up = !a.held && !a.sustained;
  const bool b_is_up = !b.held && !b.sustained;
  return a_is_up != b_is_up ? a_is_up : a.level < b.level;
}

std::size_t most_voices(const Playing& playing) {
  return static_cast<std::size_t>(std::max(1, playing.voices));
}

}  // namespace

Voices::Voices(const Playing& playing, double rate_hz, std::size_t outputs)
    : playing_(playing),
      rate_hz_(rate_hz),
      level_kept_(std::exp(-static_cast<double>(max_block_frames) / (level_memory_s * rate_hz))),
      restrikes_(std::none_of(playing.controls.begin(), playing.controls.end(),
                              [](const Control& control) {
                                return control.source == Source::note && control.has_level;
                              })),
      voices_(lane_count(playing.voices)),
      channels_(static_cast<std::uint8_t>(std::countr_zero(playing.channels) %
                                          static_cast<int>(midi_channel_count))),
      tuning_(playing.keys_hz, playing.transpose),
      is_stereo_(outputs > 1) {}

void Voices::go_on_from(const Voices& from) {
  voices_ = from.voices_;
  awake_ = from.awake_;
  last_ = from.last_;
  channels_ = from.channels_;
  tuning_ = from.tuning_;
  held_keys_ = from.held_keys_;
  last_hz_ = from.last_hz_;
  tuned_at_ = from.tuned_at_;
  turns_ = from.turns_;
  limit_ = from.limit_;
  resets_ = from.resets_;
  stolen_ = from.stolen_;
  shed_ = from.shed_;
}

// What is heard of each stays where it was, and goes from there.
void Voices::renumber(double gain_ratio) {
  for (Voice& voice : voices_) {
    if (!voice.awake) {
      continue;
    }
    voice.is_retuned = has_changed_ = true;
    if (gain_ratio != 1.0) {
      for (double& volume : voice.volume) {
        volume *= gain_ratio;
      }
      follow_level(voice);
    }
  }
}

// --- life ---------------------------------------------------------------------------------------

void Voices::start(std::size_t lane, double frequency_hz) {
  awake_ += voices_[lane].awake ? 0 : 1;
  voices_[lane] = {.awake = true,
                   .is_new = true,
                   .decay = {.pole = std::exp(-1.0 / (damper_on_s * rate_hz_))},
                   .level = 1.0,  // not yet heard: not yet the quietest
                   .frequency_hz = frequency_hz,
                   .semitones = channels_.semitones(0),
                   .release_s = playing_.damper_s};
  has_changed_ = true;
  last_ = lane;
}

bool Voices::wake(std::size_t lane) {
  const bool starts = !voices_[lane].awake;
  if (starts) {
    start(lane, voices_[lane].frequency_hz);
  }
  voices_[lane].quiet_frames = 0;
  return starts;
}

Press Voices::press_key(int key, double velocity, std::uint8_t channel, double highest_factor,
                        double frequency_hz) {
  // As it is written there is one instrument: a key is only a way to excite it.
  const bool is_one = playing_.tuning == Tuning::fixed;
  const double hz = is_one ? 0.0 : playable_hz(pitch_hz(key, frequency_hz), highest_factor);
  if (!is_one && hz == 0.0) {
    return Press::silent;
  }
  HeldKeys& held = held_keys_[channel % Channels::count];
  const bool overlaps = !held.is_empty();
  const bool glides = overlaps || !is_legato(channel);
  held.press(key, velocity, frequency_hz);
  Voice* const alone = channels_.is_mono(channel, playing_.mono) ? voice_on(channel) : nullptr;
  const bool is_struck = !overlaps || !is_legato(channel);
  if (alone != nullptr && !is_one && (alone->is_whole() || (alone->held && !is_struck))) {
    last_ = static_cast<std::size_t>(alone - voices_.data());
    attach(*alone, key, channel);
    move_to(*alone, key, frequency_hz, glides, highest_factor);
    return is_struck ? Press::strikes : Press::moves;
  }
  if (alone != nullptr && !is_one && alone->held) {
    replace(*alone);
  }
  if (!is_one && !restrikes_) {
    damp_earlier(key, channel);
  }
  const bool stays = is_one && !voices_[last_].fading && voices_[last_].is_whole();
  Voice& voice = stays ? voices_[last_] : voice_for(key, channel);
  last_ = static_cast<std::size_t>(&voice - voices_.data());
  const bool starts = is_one ? !voice.is_live() : !sounds(voice, key, channel);
  if (starts) {
    start(last_, hz);
    voice.key_hz = is_one ? 0.0 : pitch_hz(key, frequency_hz);
    voice.has_own_pitch = frequency_hz > 0.0;
  }
  attach(voice, key, channel);
  if (starts) {
    voice.volume = level_of(voice);
  }
  if (!starts && !is_one) {
    move_to(voice, key, frequency_hz, false, highest_factor);
  }
  double& before_hz = last_hz_[channel % Channels::count];
  if (starts && glides && before_hz > 0.0 && !is_one) {
    glide_from(voice, before_hz);
  }
  before_hz = hz;
  return starts ? Press::starts : Press::strikes;
}

// By a key of this channel it is held from now on.
void Voices::attach(Voice& voice, int key, std::uint8_t channel) {
  voice.has_key = true;
  voice.key = static_cast<std::uint8_t>(key);
  voice.channel = channel;
  voice.turn = ++turns_;
  voice.held = true;
  voice.sustained = voice.latched = voice.is_released = false;
  damp(voice);
  voice.quiet_frames = 0;
  if (voice.semitones != channels_.semitones(channel)) {
    voice.semitones = channels_.semitones(channel);
    voice.is_retuned = has_changed_ = true;
  }
}

std::optional<HeldKey> Voices::go_back(int key, std::uint8_t channel, double highest_factor) {
  HeldKeys& held = held_keys_[channel % Channels::count];
  held.lift(key);
  Voice* const voice = voice_on(channel);
  const bool is_alone =
      playing_.tuning == Tuning::keyboard && channels_.is_mono(channel, playing_.mono);
  const std::optional<HeldKey> earlier = held.last();
  if (!is_alone || !earlier || voice == nullptr || !voice->held || voice->key != key) {
    return std::nullopt;
  }
  last_ = static_cast<std::size_t>(voice - voices_.data());
  attach(*voice, earlier->key, channel);
  move_to(*voice, earlier->key, earlier->frequency_hz, true, highest_factor);
  return earlier;
}

// The one of this channel that was played last.
Voice* Voices::voice_on(std::uint8_t channel) {
  return least_of(
      [&](const Voice& voice) {
        return voice.is_live() && voice.has_key && voice.channel == channel;
      },
      [](const Voice& a, const Voice& b) { return a.turn > b.turn; });
}

void Voices::forget_keys(ChannelMask channels) {
  for (unsigned channel = 0; channel < held_keys_.size(); ++channel) {
    if (has_channel(channels, channel)) {
      held_keys_[channel].clear();
      last_hz_[channel] = 0.0;
    }
  }
}

// Those without a key too. What a member of an MPE zone says is for its own note only; where keys
// set no pitch there is one instrument, and everybody plays it.
bool Voices::is_for_all(const Scope& scope) const {
  return playing_.tuning == Tuning::fixed ||
         (scope.key == Scope::every_key && (scope.channels & ~channels_.members()) != 0);
}

bool Voices::hears(const Voice& voice, const Scope& scope) const {
  if (!voice.awake || !voice.has_key || playing_.tuning == Tuning::fixed) {
    return voice.awake && is_for_all(scope);
  }
  const bool was_let_go = channels_.is_member(voice.channel) && !voice.held && !voice.sustained;
  const std::uint8_t by = was_let_go ? channels_.master_of(voice.channel) : voice.channel;
  return has_channel(scope.channels, by) && (scope.key < 0 || scope.key == voice.key);
}

std::optional<std::size_t> Voices::last_of(const Scope& scope) const {
  if (hears(voices_[last_], scope) || (!voices_[last_].awake && is_for_all(scope))) {
    return last_;
  }
  std::optional<std::size_t> last;
  for (std::size_t lane = 0; lane < voices_.size(); ++lane) {
    if (voices_[lane].is_live() && hears(voices_[lane], scope) &&
        (!last || voices_[lane].turn > voices_[*last].turn)) {
      last = lane;
    }
  }
  return last;
}

bool Voices::lift_key(Voice& voice, int key, std::uint8_t channel, double velocity) const {
  if (!voice.held || voice.key != key || voice.channel != channel) {
    return false;
  }
  voice.held = false;
  voice.is_released = true;
  voice.release_s =
      playing_.damper_s * std::pow(release_reach, 2.0 * (usual_release_velocity - velocity));
  voice.sustained = voice.latched || channels_.sustains(channel);
  damp(voice);
  return !voice.sustained;
}

void Voices::set_strength(std::size_t lane, double strength) {
  Voice& voice = voices_[lane];
  voice.strength = strength;
  if (voice.is_new) {
    const SideGains level = level_of(voice);
    voice.volume = {strength * level[0], strength * level[1]};
    voice.volume_frames = 0;
  } else {
    follow_level(voice);
  }
}

// --- channels -----------------------------------------------------------------------------------

Channels::Change Voices::turn(std::uint8_t channel, int number, double value) {
  const bool held = channels_.holds(channel);
  const ChannelMask reached = channels_.reach(channel);
  const Channels::Change change = channels_.turn(channel, number, value);
  switch (change) {
    case Channels::Change::pitch:
      retune(channel);
      break;
    case Channels::Change::level:
      follow_level(channel);
      break;
    case Channels::Change::sostenuto:
      for (Voice& voice : voices_) {
        if (is_on(voice, reached) && channels_.holds(channel) != held) {
          voice.latched = !held && voice.held;
        }
      }
      damp(channel);
      break;
    case Channels::Change::zones:
    case Channels::Change::sustain:
      damp(channel);
      break;
    case Channels::Change::modulation:
    case Channels::Change::nothing:
      break;
  }
  return change;
}

void Voices::bend(std::uint8_t channel, double amount) {
  channels_.bend(channel, std::clamp(amount, -1.0, 1.0));
  retune(channel);
}

void Voices::reset_controllers(std::uint8_t channel) {
  channels_.reset(channel);
  for (Voice& voice : voices_) {
    voice.latched &= !is_on(voice, channels_.reach(channel));
  }
  retune(channel);
  follow_level(channel);
  damp(channel);
}

bool Voices::is_let_go(Voice& voice, std::uint8_t channel) const {
  return voice.sustained && is_on(voice, channels_.reach(channel)) && !voice.latched &&
         !channels_.sustains(voice.channel);
}

void Voices::follow_level(std::uint8_t channel) {
  for (Voice& voice : voices_) {
    if (voice.awake && is_on(voice, channels_.reach(channel))) {
      follow_level(voice);
    }
  }
}

void Voices::follow_level(Voice& voice) const {
  const auto frames = static_cast<std::size_t>(std::max(1.0, level_s * rate_hz_));
  const SideGains goal = level_of(voice);
  for (std::size_t side = 0; side < goal.size(); ++side) {
    voice.volume_step[side] =
        (voice.strength * goal[side] - voice.volume[side]) / static_cast<double>(frames);
  }
  voice.volume_frames = frames;
}

void Voices::damp(std::uint8_t channel) {
  for (Voice& voice : voices_) {
    if (voice.awake && is_on(voice, channels_.reach(channel))) {
      damp(voice);
    }
  }
}

// A key that is pressed again and starts a voice of its own stops what still rings by it, as a hand
// does that meets its string.
void Voices::damp_earlier(int key, std::uint8_t channel) {
  for (Voice& voice : voices_) {
    if (voice.is_live() && voice.has_key && voice.key == key && voice.channel == channel) {
      replace(voice);
    }
  }
}

// By another voice of its key, or of its channel where one plays alone.
void Voices::replace(Voice& voice) const {
  voice.held = voice.sustained = voice.latched = false;
  voice.is_released = voice.is_replaced = true;
  voice.release_s = replaced_s;
  damp(voice);
}

bool Voices::is_any_held() const {
  return std::any_of(voices_.begin(), voices_.end(), [](const Voice& voice) { return voice.held; });
}

bool Voices::is_any_under_way() const {
  return std::any_of(voices_.begin(), voices_.end(), [](const Voice& voice) {
    return voice.awake && !voice.is_new && voice.level > 0.0;
  });
}

void Voices::damp_keyless(Voice& voice) const {
  voice.is_released = true;
  damp(voice);
}

void Voices::damp(Voice& voice) const {
  constexpr double decades_of_t60 = 3.0;
  const bool may_lie = voice.is_released && !voice.latched && playing_.damper_s > 0.0;
  const double share = voice.is_replaced ? 1.0 : may_lie ? channels_.damper(voice.channel) : 0.0;
  double per_s = share / std::max(1e-3, voice.release_s);  // 60 dB
  if (voice.has_key && !playing_.decay_s.empty()) {
    per_s += 1.0 / value_at(playing_.decay_s, voice.key);
  }
  voice.decay.kept_goal = std::pow(10.0, -decades_of_t60 * per_s / rate_hz_);
}

SideGains Voices::level_of(const Voice& voice) const {
  double level = channels_.level(voice.channel);
  if (voice.has_key && !playing_.keys_db.empty()) {
    level *= std::pow(10.0, value_at(playing_.keys_db, voice.key) / 20.0);
  }
  const SideGains balance = is_stereo_ ? channels_.balance(voice.channel) : SideGains{1.0, 1.0};
  return {level * balance[0], level * balance[1]};
}

void Voices::adopt_channels(const Voices& from) {
  channels_.adopt(from.channels_);
  tuning_.adopt(from.tuning_);
  for (std::uint8_t channel = 0; channel < Channels::count; ++channel) {
    retune(channel);
    follow_level(channel);
    damp(channel);
  }
}

// --- how it ends --------------------------------------------------------------------------------

void Voices::release(Voice& voice) const {
  voice.held = voice.sustained = voice.latched = false;
  damp(voice);
}

void Voices::fade(Voice& voice, double seconds) const {
  voice.decay.fade_step = std::max(voice.decay.fade_step, 1.0 / std::max(1.0, seconds * rate_hz_));
  voice.fading = true;
  voice.held = voice.sustained = voice.latched = false;
}

void Voices::panic() {
  for (Voice& voice : voices_) {
    if (voice.awake) {
      fade(voice, steal_fade_s);
    }
  }
  channels_.lift_pedals();
  forget_keys(all_channels);
}

void Voices::silence(std::uint8_t channel) {
  for (Voice& voice : voices_) {
    if (voice.awake && is_on(voice, channels_.reach(channel))) {
      fade(voice, steal_fade_s);
    }
  }
}

void Voices::lose(Voice& voice) {
  resets_ += voice.lost ? 0 : 1;
  voice.lost = true;
}

void Voices::advance_gains(std::size_t frames) {
  for (Voice& voice : voices_) {
    if (!voice.awake) {
      continue;
    }
    if (voice.volume_frames > 0) {
      const std::size_t follows = std::min(frames, voice.volume_frames);
      for (std::size_t side = 0; side < voice.volume.size(); ++side) {
        voice.volume[side] += voice.volume_step[side] * static_cast<double>(follows);
      }
      voice.volume_frames -= follows;
    }
    if (!voice.decay.is_steady()) {
      for (std::size_t n = 0; n < frames; ++n) {
        voice.decay.advance();
      }
    }
    if (voice.lost && !voice.fading) {
      fade(voice, steal_fade_s);
    }
  }
}

bool Voices::update(Voice& voice) {
  voice.decay.settle();
  const double peak =
      voice.peak * playing_.gain * voice.decay.gain * std::max(voice.volume[0], voice.volume[1]);
  voice.peak = 0.0;
  voice.level = std::max(peak, voice.level * level_kept_);
  const double gain = voice.decay.gain;
  if ((voice.fading && gain == 0.0) || gain < damped_away) {
    end(voice);
    return false;
  }
  voice.quiet_frames = peak < quiet_level ? voice.quiet_frames + max_block_frames : 0;
  if (playing_.bare || voice.held || voice.sustained ||
      static_cast<double>(voice.quiet_frames) < quiet_s * rate_hz_) {
    return false;
  }
  voice.quiet_frames = 0;
  return true;
}

void Voices::sleep(Voice& voice) {
  const double frequency_hz = voice.frequency_hz;
  end(voice);
  voice.frequency_hz = frequency_hz;
}

void Voices::end(Voice& voice) {
  voice = Voice{};
  --awake_;
}

void Voices::add_to(EngineMeters& meters) const {
  for (const Voice& voice : voices_) {
    meters.voices += voice.is_live() && voice.level > quiet_level ? 1 : 0;
    meters.stepped += voice.is_live() ? 1 : 0;
  }
  meters.resets = resets_;
  meters.stolen = stolen_;
  meters.shed = shed_;
}

// --- who gives way ------------------------------------------------------------------------------

template <class May, class Less>
Voice* Voices::least_of(May&& may, Less&& less) {
  Voice* least = nullptr;
  for (Voice& voice : voices_) {
    if (may(voice) && (least == nullptr || less(voice, *least))) {
      least = &voice;
    }
  }
  return least;
}

// How many voices are to give way before no more sound than may, and `more`.
std::size_t Voices::too_many(std::size_t more) const {
  const auto live = static_cast<std::size_t>(std::count_if(
      voices_.begin(), voices_.end(), [](const Voice& voice) { return voice.is_live(); }));
  const std::size_t most = std::min(most_voices(playing_), limit_);
  return live + more - std::min(live + more, most);
}

void Voices::limit(std::size_t most) {
  limit_ = std::max<std::size_t>(1, most);
  const auto may_go = [&](const Voice& voice) {
    return voice.is_live() && !(&voice == &voices_[last_] && voice.held);
  };
  for (std::size_t left = too_many(0); left > 0; --left) {
    Voice& least = *least_of(may_go, is_heard_less);
    shed_ += least.level > quiet_level ? 1 : 0;
    fade(least, steal_fade_s);
  }
}

// The same key's, a free one, or the place of who gives way first.
Voice& Voices::voice_for(int key, std::uint8_t channel) {
  const auto any = [](const Voice&, const Voice&) { return false; };
  const auto sounds_key = [&](const Voice& voice) { return sounds(voice, key, channel); };
  if (Voice* const same = least_of(sounds_key, any)) {
    return *same;
  }
  if (too_many(1) > 0) {
    Voice& quietest = *least_of([](const Voice& voice) { return voice.is_live(); }, is_heard_less);
    stolen_ += quietest.level > quiet_level ? 1 : 0;
    fade(quietest, steal_fade_s);
  }
  // A reserve lane is free unless several voices were stolen within one fade; then the one
  // that has faded most goes at once.
  if (Voice* const free = least_of([](const Voice& voice) { return !voice.awake; }, any)) {
    return *free;
  }
  return *least_of([](const Voice& voice) { return voice.fading; },
                   [](const Voice& a, const Voice& b) { return a.decay.gain < b.decay.gain; });
}

// Whether a key that is pressed goes on with this voice: what a damper has touched, and what is
// as loud as its key was pressed, is left to ring out beside the new one.
bool Voices::sounds(const Voice& voice, int key, std::uint8_t channel) const {
  return restrikes_ && voice.is_live() && voice.is_whole() && voice.has_key && voice.key == key &&
         voice.channel == channel;
}

}  // namespace ressort::engine
