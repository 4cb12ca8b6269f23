#include "core/engine/voices.h"

#include <cmath>
#include <numbers>

#include "core/kernels/kernel.h"

namespace ressort {
namespace {

constexpr double steal_fade_s = 0.005;  // a voice that gives way takes this long to vanish
constexpr double level_memory_s = 0.1;  // how long a voice's level remembers a peak
constexpr double quiet_s = 0.5;         // longer than half a period of the slowest sound
constexpr double bend_semitones = 2.0;
constexpr std::size_t most_reserve_lanes = 4;

std::size_t most_voices(const Playing& playing) {
  return static_cast<std::size_t>(std::max(1, playing.voices));
}

}  // namespace

Voices::Voices(const Playing& playing, double rate_hz)
    : playing_(playing),
      rate_hz_(rate_hz),
      level_kept_(std::exp(-static_cast<double>(max_block_frames) / (level_memory_s * rate_hz))),
      voices_(most_voices(playing) + std::min(most_voices(playing), most_reserve_lanes)) {}

void Voices::go_on_from(const Voices& from) {
  voices_ = from.voices_;
  awake_ = from.awake_;
  last_ = from.last_;
  pedal_is_down_ = from.pedal_is_down_;
  bend_ = from.bend_;
  limit_ = from.limit_;
  resets_ = from.resets_;
  stolen_ = from.stolen_;
  shed_ = from.shed_;
}

// --- life ---------------------------------------------------------------------------------------

void Voices::start(std::size_t lane, double frequency_hz) {
  awake_ += voices_[lane].awake ? 0 : 1;
  voices_[lane] = {.awake = true,
                   .is_new = true,
                   .frequency_hz = frequency_hz,
                   .level = 1.0};  // not yet heard: not yet the quietest
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

bool Voices::press_key(int key, std::uint8_t channel, double highest_factor) {
  // As it is written there is one instrument: a key is only a way to excite it.
  const bool is_one = playing_.tuning == Tuning::fixed;
  const std::size_t lane = is_one && !voices_[last_].fading ? last_ : lane_for(key, channel);
  const bool sounds_key = is_one || (voices_[lane].key == key && voices_[lane].frequency_hz != 0.0);
  const bool starts = !is_live(lane) || !sounds_key;
  if (starts) {
    start(lane, is_one ? 0.0 : playable_hz(key, highest_factor));
  }
  last_ = lane;
  Voice& voice = voices_[lane];
  voice.key = static_cast<std::uint8_t>(key);
  voice.channel = channel;
  voice.held = true;
  voice.sustained = false;
  voice.quiet_frames = 0;
  return starts;
}

bool Voices::lift_key(Voice& voice, int key, std::uint8_t channel) const {
  if (!voice.held || voice.key != key || voice.channel != channel) {
    return false;
  }
  voice.held = false;
  voice.sustained = pedal_is_down_[channel & 15];
  return !voice.sustained;
}

void Voices::release(std::size_t lane) {
  voices_[lane].held = voices_[lane].sustained = false;
  if (playing_.release_s > 0.0) {
    fade(lane, playing_.release_s);
  }
}

void Voices::fade(std::size_t lane, double seconds) {
  Voice& voice = voices_[lane];
  const double step = -1.0 / std::max(1.0, seconds * rate_hz_);
  voice.gain_step = std::min(voice.gain_step, step);
  voice.fading = true;
  voice.held = voice.sustained = false;
}

void Voices::panic() {
  for (std::size_t lane = 0; lane < voices_.size(); ++lane) {
    if (voices_[lane].awake) {
      fade(lane, steal_fade_s);
    }
  }
  pedal_is_down_.fill(false);
}

void Voices::lose(std::size_t lane) {
  resets_ += voices_[lane].lost ? 0 : 1;
  voices_[lane].lost = has_lost_ = true;
}

void Voices::advance_fades(std::size_t frames) {
  for (Voice& voice : voices_) {
    for (std::size_t n = 0; n < frames && voice.gain_step != 0.0; ++n) {
      voice.gain = voice.next_gain(voice.gain);
    }
  }
  for (std::size_t lane = 0; has_lost_ && lane < voices_.size(); ++lane) {
    if (voices_[lane].lost && !voices_[lane].fading) {
      fade(lane, steal_fade_s);
    }
  }
  has_lost_ = false;
}

bool Voices::update(std::size_t lane) {
  Voice& voice = voices_[lane];
  const double peak = voice.peak * playing_.gain * voice.gain;
  voice.peak = 0.0;
  voice.level = std::max(peak, voice.level * level_kept_);
  if (voice.fading && voice.gain == 0.0) {
    end(lane);
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

void Voices::sleep(std::size_t lane) {
  const double frequency_hz = voices_[lane].frequency_hz;
  end(lane);
  voices_[lane].frequency_hz = frequency_hz;
}

void Voices::end(std::size_t lane) {
  voices_[lane] = Voice{};
  --awake_;
}

void Voices::add_to(EngineMeters& meters) const {
  for (std::size_t lane = 0; lane < voices_.size(); ++lane) {
    meters.voices += is_live(lane) && voices_[lane].level > quiet_level ? 1 : 0;
    meters.stepped += is_live(lane) ? 1 : 0;
  }
  meters.resets = resets_;
  meters.stolen = stolen_;
  meters.shed = shed_;
}

// --- who gives way ------------------------------------------------------------------------------

std::size_t Voices::most_live() const {
  return std::min(most_voices(playing_), limit_);
}

void Voices::limit(std::size_t most) {
  limit_ = std::max<std::size_t>(1, most);
  std::size_t live = 0;
  for (std::size_t lane = 0; lane < voices_.size(); ++lane) {
    live += is_live(lane) ? 1 : 0;
  }
  const auto is_heard_less = [](const Voice& a, const Voice& b) {
    const bool a_is_up = !a.held && !a.sustained;
    const bool b_is_up = !b.held && !b.sustained;
    return a_is_up != b_is_up ? a_is_up : a.level < b.level;
  };
  for (; live > most_live(); --live) {
    std::size_t least = voices_.size();
    for (std::size_t lane = 0; lane < voices_.size(); ++lane) {
      const bool may_go = is_live(lane) && !(lane == last_ && voices_[lane].held);
      if (may_go && (least == voices_.size() || is_heard_less(voices_[lane], voices_[least]))) {
        least = lane;
      }
    }
    shed_ += voices_[least].level > quiet_level ? 1 : 0;
    fade(least, steal_fade_s);
  }
}

// The same key's, a free one, or the quietest's place.
std::size_t Voices::lane_for(int key, std::uint8_t channel) {
  std::size_t live = 0;
  std::size_t quietest = voices_.size();
  for (std::size_t lane = 0; lane < voices_.size(); ++lane) {
    if (!is_live(lane)) {
      continue;
    }
    const Voice& voice = voices_[lane];
    if (voice.frequency_hz > 0.0 && voice.key == key && voice.channel == channel) {
      return lane;
    }
    ++live;
    if (quietest == voices_.size() || voice.level < voices_[quietest].level) {
      quietest = lane;
    }
  }
  if (live >= most_live()) {
    stolen_ += voices_[quietest].level > quiet_level ? 1 : 0;
    fade(quietest, steal_fade_s);
  }
  // A reserve lane is free unless several voices were stolen within one fade; then the one
  // that has faded most goes at once.
  std::size_t faintest = voices_.size();
  for (std::size_t lane = 0; lane < voices_.size(); ++lane) {
    if (!voices_[lane].awake) {
      return lane;
    }
    if (voices_[lane].fading &&
        (faintest == voices_.size() || voices_[lane].gain < voices_[faintest].gain)) {
      faintest = lane;
    }
  }
  return faintest;
}

// --- tuning -------------------------------------------------------------------------------------

double stiffness_factor(double mode_stiffness, double mode_damping, double frequency_hz,
                        double rate_hz) {
  if (!(mode_stiffness > 0.0)) {
    return 1.0;
  }
  const double theta = 2.0 * std::numbers::pi * frequency_hz / rate_hz;
  const double z = std::clamp(mode_damping, 0.0, 0.999);
  const double stiffness = 2.0 - z - 2.0 * std::sqrt(1.0 - z) * std::cos(theta);
  return std::max(1e-6, stiffness / mode_stiffness);
}

double Voices::factor_at(double frequency_hz) const {
  return stiffness_factor(playing_.mode_stiffness, playing_.mode_damping, frequency_hz, rate_hz_);
}

// The key's frequency, brought by octaves to where the model is stable.
double Voices::playable_hz(int key, double highest_factor) const {
  double hz = 440.0 * std::exp2((key + playing_.transpose - 69) / 12.0);
  while (hz > 1.0 && (hz >= 0.5 * rate_hz_ || factor_at(hz) > highest_factor)) {
    hz *= 0.5;
  }
  return hz;
}

double Voices::factor_for(const Voice& voice, double highest_factor) const {
  const double bent = std::exp2(bend_ * bend_semitones / 12.0);
  const double factor =
      voice.frequency_hz > 0.0 ? factor_at(voice.frequency_hz * bent) : bent * bent;
  return std::min(factor, highest_factor);
}

double Voices::factor_of(std::size_t lane, double highest_factor) const {
  const Voice& voice = voices_[lane];
  return voice.is_new || voice.is_retuned ? factor_for(voice, highest_factor) : voice.factor;
}

void Voices::bend(double amount) {
  bend_ = std::clamp(amount, -1.0, 1.0);
  for (Voice& voice : voices_) {
    voice.is_retuned |= voice.awake;
    has_changed_ |= voice.awake;
  }
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

}  // namespace ressort
