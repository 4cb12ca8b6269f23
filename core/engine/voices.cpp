#include "core/engine/voices.h"

#include <cmath>

#include "core/engine/event.h"
#include "core/kernels/kernel.h"

namespace ressort::engine {
namespace {

constexpr double steal_fade_s = 0.005;   // fade of a stolen voice
constexpr double level_memory_s = 0.1;   // release time constant of a voice's level
constexpr double quiet_s = 0.5;          // longer than half a period of the lowest sound
constexpr double damper_on_s = 0.005;    // time constant with which a damper engages
constexpr double inaudible_gain = 1e-6;  // a damped voice below this gain ends

// The order of stealing: silent voices, then those that another has replaced, released ones, and
// those that are held; quieter ones first.
bool is_stolen_before(const Voice& a, const Voice& b) {
  const auto rank = [](const Voice& voice) {
    return voice.held || voice.sustained ? 3
           : voice.level <= quiet_level  ? 0
           : voice.is_replaced           ? 1
                                         : 2;
  };
  return rank(a) != rank(b) ? rank(a) < rank(b) : a.level < b.level;
}

}  // namespace

Voices::Voices(const Playing& playing, double rate_hz)
    : playing_(playing),
      rate_hz_(rate_hz),
      throws_(std::any_of(playing.controls.begin(), playing.controls.end(),
                          [](const Control& control) { return control.throws; })),
      level_kept_(std::exp(-static_cast<double>(max_block_frames) / (level_memory_s * rate_hz))),
      voices_(lane_count(playing.voices)),
      swings_(playing.swings_parameters() ? voices_.size() * playing.curves.size() : 0) {}

void Voices::continue_from(const Voices& from) {
  voices_ = from.voices_;
  for (Voice& voice : voices_) {
    voice.beside = nullptr;
  }
  if (swings_.size() == from.swings_.size()) {
    swings_ = from.swings_;
  }
  awake_ = from.awake_;
  latest_ = from.latest_;
  limit_ = from.limit_;
  resets_ = from.resets_;
  stolen_ = from.stolen_;
  shed_ = from.shed_;
}

void Voices::swing(std::size_t lane, std::span<const double> amounts) {
  const auto own = swings_.begin() + static_cast<std::ptrdiff_t>(lane * amounts.size());
  if (!std::equal(amounts.begin(), amounts.end(), own)) {
    std::copy(amounts.begin(), amounts.end(), own);
    mark_retuned(voices_[lane]);
  }
}

bool Voices::is_any_held() const {
  return std::any_of(voices_.begin(), voices_.end(), [](const Voice& voice) { return voice.held; });
}

bool Voices::is_any_audible() const {
  return std::any_of(voices_.begin(), voices_.end(), [](const Voice& voice) {
    return voice.awake && !voice.is_new && voice.level > 0.0;
  });
}

// --- start and end ------------------------------------------------------------------------------

void Voices::start(std::size_t lane, double frequency_hz, double semitones) {
  awake_ += voices_[lane].awake ? 0 : 1;
  voices_[lane] = {.awake = true,
                   .is_new = true,
                   .decay = {.pole = std::exp(-1.0 / (damper_on_s * rate_hz_))},
                   .level = 1.0,  // not heard yet, so not yet the quietest
                   .frequency_hz = frequency_hz,
                   .semitones = semitones,
                   .release_s = playing_.damper_on(middle_c),
                   .release_velocity = usual_release_velocity};
  has_changed_ = true;
  latest_ = lane;
}

void Voices::fade(Voice& voice) const {
  voice.decay.fade_step =
      std::max(voice.decay.fade_step, 1.0 / std::max(1.0, steal_fade_s * rate_hz_));
  voice.fading = true;
  voice.held = voice.sustained = voice.latched = false;
}

void Voices::mark_unstable(Voice& voice) {
  resets_ += voice.unstable ? 0 : 1;
  voice.unstable = true;
}

void Voices::sleep(Voice& voice) {
  const double frequency_hz = voice.frequency_hz;
  free(voice);
  voice.frequency_hz = frequency_hz;
}

void Voices::free(Voice& voice) {
  voice = Voice{};
  --awake_;
}

void Voices::clear_changes() {
  for (Voice& voice : voices_) {
    voice.is_new = voice.is_retuned = false;
  }
  has_changed_ = false;
}

// --- stealing -----------------------------------------------------------------------------------

// Returns how many voices must end before `more` new ones may start.
std::size_t Voices::count_excess(std::size_t more) const {
  const auto live = static_cast<std::size_t>(std::count_if(
      voices_.begin(), voices_.end(), [](const Voice& voice) { return voice.is_live(); }));
  const std::size_t most =
      std::min<std::size_t>(static_cast<std::size_t>(std::max(1, playing_.voices)), limit_);
  return live + more - std::min(live + more, most);
}

void Voices::limit(std::size_t most) {
  limit_ = std::max<std::size_t>(1, most);
  const auto may_end = [&](const Voice& voice) {
    return voice.is_live() && !(&voice == &voices_[latest_] && voice.held);
  };
  for (std::size_t left = count_excess(0); left > 0; --left) {
    Voice& least = *least_of(may_end, is_stolen_before);
    shed_ += least.level > quiet_level && !least.is_replaced ? 1 : 0;
    fade(least);
  }
}

Voice& Voices::take_lane() {
  if (count_excess(1) > 0) {
    Voice& quietest =
        *least_of([](const Voice& voice) { return voice.is_live(); }, is_stolen_before);
    stolen_ += quietest.level > quiet_level && !quietest.is_replaced ? 1 : 0;
    fade(quietest);
  }
  // A reserve lane is free unless several voices were stolen within one fade. Then the voice that
  // has faded most is cut off.
  const auto first = [](const Voice&, const Voice&) { return false; };
  if (Voice* const free = least_of([](const Voice& voice) { return !voice.awake; }, first)) {
    return *free;
  }
  return *least_of([](const Voice& voice) { return voice.fading; },
                   [](const Voice& a, const Voice& b) { return a.decay.gain < b.decay.gain; });
}

// --- gains --------------------------------------------------------------------------------------

void Voices::damp(Voice& voice, double share) const {
  constexpr double decades_of_t60 = 3.0;
  const double per_s = share / std::max(1e-3, voice.release_s);  // in units of 60 dB
  voice.decay.kept_goal = std::pow(10.0, -decades_of_t60 * per_s / rate_hz_);
}

void Voices::ramp_volume(Voice& voice, const SideGains& level, double seconds) const {
  set_ramp(voice, level, static_cast<std::size_t>(std::max(1.0, seconds * rate_hz_)));
}

void Voices::follow_volume(Voice& voice, const SideGains& level) const {
  set_ramp(voice, level, std::max(max_block_frames, voice.volume_frames));
}

void Voices::set_ramp(Voice& voice, const SideGains& level, std::size_t frames) {
  for (std::size_t side = 0; side < level.size(); ++side) {
    voice.volume_step[side] =
        (voice.strength * level[side] - voice.volume[side]) / static_cast<double>(frames);
  }
  voice.volume_frames = frames;
}

void Voices::advance_glides() {
  for (Voice& voice : voices_) {
    if (voice.awake && voice.glide != 0.0) {
      const double left = std::max(0.0, std::fabs(voice.glide) - voice.glide_step);
      voice.glide = std::copysign(left, voice.glide);
      mark_retuned(voice);
    }
  }
}

void Voices::advance_gains(std::size_t frames) {
  for (Voice& voice : voices_) {
    if (!voice.awake) {
      continue;
    }
    if (voice.volume_frames > 0) {
      const std::size_t ramped = std::min(frames, voice.volume_frames);
      for (std::size_t side = 0; side < voice.volume.size(); ++side) {
        voice.volume[side] += voice.volume_step[side] * static_cast<double>(ramped);
      }
      voice.volume_frames -= ramped;
    }
    if (!voice.decay.is_steady()) {
      for (std::size_t n = 0; n < frames; ++n) {
        voice.decay.advance();
      }
    }
    if (voice.unstable && !voice.fading) {
      fade(voice);
    }
  }
}

bool Voices::update(Voice& voice) {
  voice.decay.finish_approach();
  const double peak = voice.peak * playing_.heard_gain() * voice.decay.gain *
                      std::max(std::fabs(voice.volume[0]), std::fabs(voice.volume[1]));
  voice.peak = 0.0;
  voice.level = std::max(peak, voice.level * level_kept_);
  const double gain = voice.decay.gain;
  if ((voice.fading && gain == 0.0) || gain < inaudible_gain) {
    free(voice);
    return false;
  }
  voice.quiet_frames = peak < quiet_level ? voice.quiet_frames + max_block_frames : 0;
  voice.quiet_spans = peak < quiet_level ? voice.quiet_spans : 0;
  if (playing_.bare || voice.held || voice.sustained ||
      static_cast<double>(voice.quiet_frames) < quiet_s * rate_hz_) {
    return false;
  }
  voice.quiet_frames = 0;
  ++voice.quiet_spans;
  return true;
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

}  // namespace ressort::engine
