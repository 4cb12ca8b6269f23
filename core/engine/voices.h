// core/engine: the pool of voices: starting, stealing, fading, sleeping, gains and meters.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "core/engine/playing.h"
#include "core/engine/readings.h"

namespace ressort::engine {

inline constexpr double quiet_level = 1e-5;  // -100 dBFS

// Returns the number of lanes for `voices` voices: some more, for voices that fade.
inline std::size_t lane_count(int voices) {
  constexpr std::size_t most_in_reserve = 4;
  const auto wanted = static_cast<std::size_t>(std::max(1, voices));
  return wanted + std::min(wanted, most_in_reserve);
}

// The gain of a voice that is damped or faded, sample by sample. A damper that takes the same share
// of every velocity makes all modes of a linear network decay by one common factor and shifts no
// pitch. It is therefore computed as a gain and costs nothing in the kernels.
struct Decay {
  double gain = 1.0;
  double fade_step = 0.0;  // subtracted from the gain in each sample of a fade
  double kept = 1.0;       // factor that the damper applies in each sample
  double kept_goal = 1.0;  // target of `kept`, which follows without a step
  double pole = 0.0;       // pole of the filter from `kept` to `kept_goal`

  bool is_steady() const { return fade_step == 0.0 && kept == 1.0 && kept_goal == 1.0; }
  void advance() {
    kept = kept_goal + pole * (kept - kept_goal);
    gain = std::max(0.0, gain * kept - fade_step);
  }
  // Ends the approach to `kept_goal`, which the filter alone would never complete.
  void finish_approach() {
    constexpr double nothing = 1e-12;
    kept = std::fabs(kept - kept_goal) < nothing ? kept_goal : kept;
  }
};

struct alignas(64) Voice {
  bool is_live() const { return awake && !fading; }
  // The damper has not taken anything yet.
  bool is_undamped() const { return decay.gain > 0.99; }

  // All outputs keep one common gain for the whole segment.
  bool is_steady() const {
    return decay.is_steady() && volume_frames == 0 && volume[0] == volume[1];
  }

  // The fields that every block reads come first and share cache lines.
  bool awake = false;        // computed and mixed
  bool unstable = false;     // out of bounds: frozen at its last sane sample, then faded
  bool fading = false;       // stolen or ended; the lane is free after the fade
  bool held = false;         // held by a key
  bool sustained = false;    // held by a pedal after its key was released
  bool latched = false;      // held by the sostenuto pedal
  bool is_new = false;       // its kernels must be reset before they step
  bool is_retuned = false;   // its kernels must be retuned before they step
  bool has_key = false;      // if not, it belongs to every channel
  bool is_released = false;  // its key has been released
  bool is_replaced = false;  // another voice has taken its key or its channel
  std::uint8_t key = 0;
  std::uint8_t struck_key = 0;  // key of its last strike
  std::uint8_t channel = 0;
  bool has_own_pitch = false;  // given by the note, not by the key
  Decay decay;
  SideGains volume = {1.0, 1.0};  // strength times the channel's level
  std::size_t volume_frames = 0;  // frames left of the volume ramp
  double peak = 0.0;              // peak of the network's output since the last update
  SideGains volume_step = {};     // per frame of the ramp
  double strength = 1.0;          // gain by velocity
  double velocity = 0.0;          // velocity of its last strike, 0..1, after the preset's curve
  double level = 0.0;             // output peak with a slow release
  std::size_t quiet_frames = 0;
  std::size_t quiet_spans = 0;    // of 0.5 s, since its last sound
  std::uint64_t turn = 0;         // serial number of its key press
  const Voice* beside = nullptr;  // earlier voice of its key, with which it is compared
  std::size_t compared_frames = 0;
  double agreement = 0.0;  // running sum of products of both, without their signs
  double power = 0.0;      // running sums of squares
  double power_beside = 0.0;
  double frequency_hz = 0.0;      // without bend; 0: as the model is written
  double sounding_hz = 0.0;       // with bend, glide and vibrato
  double key_hz = 0.0;            // requested frequency, before the stability limit
  double semitones = 0.0;         // its own channel's bend and tuning
  double vibrato = 0.0;           // semitones by LFOs
  double tremolo = 1.0;           // gain by LFOs
  double glide = 0.0;             // semitones left of the glide
  double glide_step = 0.0;        // semitones per max_block_frames
  double factor = 1.0;            // factor on every stiffness
  double release_s = 0.0;         // T60 of its damper, by release velocity
  double release_velocity = 0.0;  // 0..1
};

// Returns a parameter's value in one voice. `shared`: the value that all voices share, or the knob
// that moves the parameter's curve. A voice without a key has the shared value, as has a voice that
// all keys play. [audio] wait-free
inline double value_in_voice(const Playing& playing, std::size_t parameter, double shared,
                             const Voice& voice) {
  const VoiceCurve* const curve =
      playing.tuning == Tuning::keyboard && voice.has_key ? playing.curve_of(parameter) : nullptr;
  constexpr double highest_velocity = 127.0;
  return curve == nullptr ? shared
                          : curve->at(curve->is_of_blow ? voice.struck_key : voice.key,
                                      highest_velocity * voice.velocity, shared);
}

// All functions but the constructor: [audio] wait-free, O(voices).
class Voices {
 public:
  Voices(const Playing& playing, double rate_hz);
  // Takes over the state of another engine's voices.
  void continue_from(const Voices& from);

  std::size_t size() const { return voices_.size(); }
  Voice& operator[](std::size_t lane) { return voices_[lane]; }
  const Voice& operator[](std::size_t lane) const { return voices_[lane]; }
  auto begin() { return voices_.begin(); }
  auto end() { return voices_.end(); }
  std::size_t lane_of(const Voice& voice) const {
    return static_cast<std::size_t>(&voice - voices_.data());
  }
  bool is_idle() const { return awake_ == 0; }
  // Returns the first lane behind all awake ones.
  std::size_t awake_end() const {
    std::size_t end = voices_.size();
    while (end > 0 && !voices_[end - 1].awake) {
      --end;
    }
    return end;
  }
  // The lane that was played last. An event without a key acts on it.
  std::size_t latest() const { return latest_; }
  void set_latest(const Voice& voice) { latest_ = lane_of(voice); }
  bool is_any_held() const;
  bool is_any_audible() const;  // has sounded before this segment

  // Puts a lane to the model's start; 0 Hz: at the written pitch.
  void start(std::size_t lane, double frequency_hz, double semitones);
  // Returns a lane for a new note: a free one, after stealing the quietest voice if needed.
  Voice& take_lane();
  // Returns the least of the voices for which may() is true; null if there is none.
  template <class May, class Less>
  Voice* least_of(May&& may, Less&& less) {
    Voice* least = nullptr;
    for (Voice& voice : voices_) {
      if (may(voice) && (least == nullptr || less(voice, *least))) {
        least = &voice;
      }
    }
    return least;
  }

  // Sets the damper: `share` of it lies on the voice.
  void damp(Voice& voice, double share) const;
  // Ramps the volume to strength * `level`.
  void ramp_volume(Voice& voice, const SideGains& level, double seconds = 0.02) const;
  // Ramps it within one block, or to the end of the current ramp.
  void follow_volume(Voice& voice, const SideGains& level) const;
  // Compares a new voice with an earlier one of its key from now on; see Comparison.
  void compare(Voice& voice, const Voice& earlier) {
    voice.beside = &earlier;
    is_comparing_ = true;
  }
  bool is_comparing() const { return is_comparing_; }
  void set_comparing(bool is_comparing) { is_comparing_ = is_comparing; }
  // Fades the voice out within 5 ms, as a stolen voice.
  void fade(Voice& voice) const;
  void limit(std::size_t most);
  void mark_unstable(Voice& voice);
  // Marks the voice for a new stiffness factor before its kernels step.
  void mark_retuned(Voice& voice) {
    voice.is_retuned = true;
    has_changed_ = true;
  }
  // Sets the factors or offsets of a voice's parameters by LFOs, [parameter] (core/curve.h). The
  // number of them is that of swings_in(), which is 0 if no LFO moves a parameter.
  void swing(std::size_t lane, std::span<const double> amounts);
  std::span<const double> swings_in(std::size_t lane) const {
    const std::size_t count = swings_.size() / voices_.size();
    return std::span(swings_).subspan(lane * count, count);
  }
  // Some voice is new or retuned, and the kernels do not know it yet.
  bool has_changed() const { return has_changed_; }
  void clear_changes();

  // Advances glides. Called once in max_block_frames.
  void advance_glides();
  // Advances the gains of voices after a segment.
  void advance_gains(std::size_t frames);
  // Updates the level of an awake voice, and ends it when its fade is complete. Called once in
  // max_block_frames. Returns true if the voice has been quiet for so long that it may sleep.
  bool update(Voice& voice);
  // Returns whether a voice has been quiet for so long that it may sleep although something moves:
  // a hammer that has flown away never comes to rest.
  bool may_sleep_moving(const Voice& voice) const {
    constexpr std::size_t long_quiet_spans = 10;
    return throws_ && voice.quiet_spans >= long_quiet_spans;
  }
  // Frees the lane. A later wake() starts it at the same pitch.
  void sleep(Voice& voice);

  void add_to(EngineMeters& meters) const;

 private:
  void free(Voice& voice);
  static void set_ramp(Voice& voice, const SideGains& level, std::size_t frames);
  std::size_t count_excess(std::size_t more) const;

  const Playing& playing_;
  double rate_hz_;
  bool throws_;        // notes throw a mass, such as a hammer
  double level_kept_;  // share of the level kept from one update to the next
  std::vector<Voice> voices_;
  std::vector<double> swings_;  // [lane][parameter]
  std::size_t awake_ = 0;
  std::size_t latest_ = 0;
  bool has_changed_ = false;
  bool is_comparing_ = false;  // some voice is compared
  std::size_t limit_ = std::numeric_limits<std::size_t>::max();
  std::uint64_t resets_ = 0;
  std::uint64_t stolen_ = 0;
  std::uint64_t shed_ = 0;
};

}  // namespace ressort::engine
