// core/engine: the life of voices: which of them starts, is held, gives way, fades and sleeps, and
// how each is tuned.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "core/engine/engine.h"
#include "core/engine/midi/channels.h"
#include "core/engine/midi/held_keys.h"
#include "core/engine/midi/key_tuning.h"

namespace ressort::engine {

inline constexpr double quiet_level = 1e-5;  // -100 dBFS

// Of an engine with so many voices: some more, for those that fade.
inline std::size_t lane_count(int voices) {
  constexpr std::size_t most_in_reserve = 4;
  const auto wanted = static_cast<std::size_t>(std::max(1, voices));
  return wanted + std::min(wanted, most_in_reserve);
}

// What is left of a voice's output, from sample to sample, by what ends it. A damper that takes its
// share of every velocity makes every motion of a linear network decay by one and the same factor,
// and moves no pitch: so it is a gain, and costs nothing elsewhere.
struct Decay {
  double gain = 1.0;
  double fade_step = 0.0;  // taken off the gain in each sample, of a voice that gives way
  double kept = 1.0;       // of the gain by the damper, from one sample to the next,
  double kept_goal = 1.0;  // which comes on and goes off without a step
  double pole = 0.0;       // by this much of the difference in each sample

  bool is_steady() const { return fade_step == 0.0 && kept == 1.0 && kept_goal == 1.0; }
  void advance() {
    kept = kept_goal + pole * (kept - kept_goal);
    gain = std::max(0.0, gain * kept - fade_step);
  }
  // Near enough is there: a filter of its own would take for ever.
  void settle() {
    constexpr double nothing = 1e-12;
    kept = std::fabs(kept - kept_goal) < nothing ? kept_goal : kept;
  }
};

// Who is meant by what is said to a channel: the voices on these channels, of one key or of all.
struct Scope {
  static constexpr int every_key = -1;
  ChannelMask channels = all_channels;
  int key = every_key;
};

// What a key that goes down does to the voice that is the last from now on.
enum class Press : std::uint8_t {
  silent,   // nothing: the key has no pitch, or none that can be played
  starts,   // it begins
  strikes,  // it sounds already, and is excited again
  moves,    // it only goes to another pitch
};

struct alignas(64) Voice {
  bool is_live() const { return awake && !fading; }
  // Nothing has taken anything off it yet.
  bool is_whole() const { return decay.gain > 0.99; }

  // All outputs have the same gain, throughout.
  bool is_steady() const {
    return decay.is_steady() && volume_frames == 0 && volume[0] == volume[1];
  }

  // What every block asks of each voice lies side by side.
  bool awake = false;        // steps and is heard
  bool lost = false;         // its stability: it fades from where it was
  bool fading = false;       // gives way; its lane is free when the fade ends
  bool held = false;         // by a key
  bool sustained = false;    // by a pedal, its key being up
  bool latched = false;      // by the sostenuto pedal, which went down while the key was
  bool is_new = false;       // its kernels are to be put to the start,
  bool is_retuned = false;   // or to its factor, before they step
  bool has_key = false;      // if not, it belongs to every channel
  bool is_released = false;  // its key has been up since it was pressed
  bool is_replaced = false;  // by another voice, of its key or its channel
  std::uint8_t key = 0;
  std::uint8_t channel = 0;
  bool has_own_pitch = false;  // which is not its key's
  Decay decay;
  // Its strength and its channel's level, which it follows in equal steps.
  SideGains volume = {1.0, 1.0};
  std::size_t volume_frames = 0;  // until it is there
  double peak = 0.0;              // of the network's output since the last update
  SideGains volume_step = {};
  double strength = 1.0;  // of the output, by how hard the key was pressed
  double level = 0.0;     // peak of the output, slowly forgotten
  std::size_t quiet_frames = 0;
  std::uint64_t turn = 0;     // so many keys went down before its own
  double frequency_hz = 0.0;  // without bend; 0: as the model is written
  double key_hz = 0.0;        // the same before it was brought to where the model is stable
  double semitones = 0.0;     // of its own channel's bend and tuning
  double glide = 0.0;         // semitones that it is still away from its pitch,
  double glide_step = 0.0;    // and how many it goes in max_block_frames
  double factor = 1.0;        // on every stiffness
  double release_s = 0.0;     // T60 that its damper wants, by how fast the key went up
};

// As many as may sound, and some lanes in reserve for those that fade. All functions: [audio]
// wait-free, O(voices). A `highest_factor` is what Parameters say.
class Voices {
 public:
  // `outputs` are the channels of sound that there are: of one the pan moves nothing.
  Voices(const Playing& playing, double rate_hz, std::size_t outputs);
  // Where the parameter of Playing::along is from now on: voices that are awake are retuned.
  void tune_at(double value);
  // What the voice's factor on every stiffness would be where that parameter started.
  double first_factor(const Voice& voice) const;
  // What another engine's voices are in the midst of.
  void go_on_from(const Voices& from);
  // After it: the model's numbers are others, and its gain is 1/`gain_ratio` of what it was.
  void renumber(double gain_ratio);

  std::size_t size() const { return voices_.size(); }
  Voice& operator[](std::size_t lane) { return voices_[lane]; }
  const Voice& operator[](std::size_t lane) const { return voices_[lane]; }
  bool is_idle() const { return awake_ == 0; }  // nobody is awake
  // The first lane of those behind all that are awake.
  std::size_t awake_end() const {
    std::size_t end = voices_.size();
    while (end > 0 && !voices_[end - 1].awake) {
      --end;
    }
    return end;
  }
  // The lane that was played last: what names no key acts on it.
  std::size_t last() const { return last_; }
  // The same among those that are meant; nothing where nobody is.
  std::optional<std::size_t> last_of(const Scope& scope) const;
  // Whether the voice is awake and meant. A member of an MPE zone that was let go hears its master
  // only: its channel may be another note's by now.
  bool hears(const Voice& voice, const Scope& scope) const;
  ChannelMask reach(std::uint8_t channel) const { return channels_.reach(channel); }

  // To the model's start, at this pitch; 0 Hz: as the model is written.
  void start(std::size_t lane, double frequency_hz);
  // Whether the voice slept, and starts.
  bool wake(std::size_t lane);
  // `frequency_hz` above 0 is its pitch in place of the key's.
  Press press_key(int key, double velocity, std::uint8_t channel, double highest_factor,
                  double frequency_hz = 0.0);
  // A key goes up. Where one voice plays the last of those that are down, it goes back to the one
  // before: that key, and nothing is to be released.
  std::optional<HeldKey> go_back(int key, std::uint8_t channel, double highest_factor);
  bool is_legato(std::uint8_t channel) const {
    return playing_.legato || channels_.is_legato(channel);
  }
  // A key goes up, this fast of 0..1: whether that releases this voice.
  bool lift_key(Voice& voice, int key, std::uint8_t channel, double velocity) const;
  // What a controller says to its channel, or what its bend is; `sustain` and `sostenuto` may let
  // voices go, which is the caller's.
  Channels::Change turn(std::uint8_t channel, int number, double value);
  void bend(std::uint8_t channel, double amount);
  void reset_controllers(std::uint8_t channel);
  double modulation(std::uint8_t channel) const { return channels_.modulation(channel); }
  void set_mono(std::uint8_t channel, bool is_mono) { channels_.set_mono(channel, is_mono); }
  bool is_mono(std::uint8_t channel) const { return channels_.is_mono(channel, playing_.mono); }
  ChannelMask rezoned() const { return channels_.rezoned(); }
  void forget_keys(ChannelMask channels);  // as if none were down
  // Of EventKind::key_tuning and tuning_reset.
  void retune_key(std::size_t key, double frequency_hz, bool is_now, double highest_factor);
  void reset_tuning(double highest_factor);
  void adopt_channels(const Voices& from);
  // Once in max_block_frames.
  void glide_on();
  bool is_any_held() const;
  bool is_any_under_way() const;  // heard already, not about to start
  // Lays the damper on a voice that no key has started, as on those whose keys are up.
  void damp_keyless(Voice& voice) const;
  // Whether a pedal that went up lets this voice go.
  bool is_let_go(Voice& voice, std::uint8_t channel) const;
  double softness(std::uint8_t channel) const { return channels_.softness(channel); }
  // How loud the voice is, beside its channel's level and its key's: at once where it starts, else
  // in 20 ms.
  void set_strength(std::size_t lane, double strength);
  void release(Voice& voice) const;
  void limit(std::size_t most);
  void panic();
  void silence(std::uint8_t channel);

  // The voice's factor on every stiffness, even if its kernels have yet to know.
  double factor_of(std::size_t lane, double highest_factor) const;
  // Whether kernels have to be told of a voice that is new or retuned. Those are tuned by
  // retune(), and all others that are awake if `all` says so; then kernels were told.
  bool has_changed() const { return has_changed_; }
  void retune(bool all, double highest_factor);
  void forget_changes();

  // The output has left its bounds: the voice fades as soon as the segment is over.
  void lose(Voice& voice);
  // The gains of voices that fade or follow their channel, after a segment.
  void advance_gains(std::size_t frames);
  // Of one that is awake, once in max_block_frames: keeps its level, and ends it where it has
  // faded. True if it has been quiet for so long that it may sleep unless something moves it.
  bool update(Voice& voice);
  // From here it wakes at the same pitch.
  void sleep(Voice& voice);

  void add_to(EngineMeters& meters) const;

 private:
  void fade(Voice& voice, double seconds) const;
  // Lays the damper on, or lifts it, as its key and pedals say.
  void damp(Voice& voice) const;
  void damp(std::uint8_t channel);
  void damp_earlier(int key, std::uint8_t channel);
  void replace(Voice& voice) const;
  void retune(std::uint8_t channel);
  void follow_level(Voice& voice) const;
  void follow_level(std::uint8_t channel);
  SideGains level_of(const Voice& voice) const;
  bool is_for_all(const Scope& scope) const;
  static bool is_on(const Voice& voice, ChannelMask channels) {
    return has_channel(channels, voice.channel);
  }
  void attach(Voice& voice, int key, std::uint8_t channel);
  // Of a key, or of its own if it is above 0.
  double pitch_hz(int key, double own_hz) const;
  void move_to(Voice& voice, int key, double own_hz, bool glides, double highest_factor);
  void glide_from(Voice& voice, double frequency_hz);
  Voice* voice_on(std::uint8_t channel);
  // The least of the voices for which `may` says so; null where there is none.
  template <class May, class Less>
  Voice* least_of(May&& may, Less&& less);
  void end(Voice& voice);
  std::size_t too_many(std::size_t more) const;
  bool sounds(const Voice& voice, int key, std::uint8_t channel) const;
  double factor_at(double frequency_hz) const;
  double playable_hz(double hz, double highest_factor) const;
  Voice& voice_for(int key, std::uint8_t channel);
  double factor_for(const Voice& voice, double highest_factor) const;

  const Playing& playing_;
  double rate_hz_;
  double level_kept_;  // from one update to the next
  bool restrikes_;     // a key that is pressed again goes on with its voice
  std::vector<Voice> voices_;
  std::size_t awake_ = 0;
  std::size_t last_ = 0;
  Channels channels_;
  KeyTuning tuning_;
  bool is_stereo_;
  std::array<HeldKeys, Channels::count> held_keys_;  // [channel]
  std::array<double, Channels::count> last_hz_{};    // [channel] of its last key; 0: none
  double tuned_at_ = 0.0;
  std::uint64_t turns_ = 0;
  bool has_changed_ = false;
  std::size_t limit_ = std::numeric_limits<std::size_t>::max();
  std::uint64_t resets_ = 0;
  std::uint64_t stolen_ = 0;
  std::uint64_t shed_ = 0;
};

}  // namespace ressort::engine
