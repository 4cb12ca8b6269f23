// core/engine: keys, channels and pedals: which voice plays a key, how long, at which pitch and
// level.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "core/engine/midi/channels.h"
#include "core/engine/voice_tuning.h"
#include "core/engine/voices.h"

namespace ressort::engine {

// The voices that an event addresses: those on some channels, of one key or of all.
struct Scope {
  static constexpr int every_key = -1;
  ChannelMask channels = all_channels;
  int key = every_key;
};

// The effect of a key press on the latest voice.
enum class Press : std::uint8_t {
  silent,   // none: the key has no playable pitch
  starts,   // the voice starts
  strikes,  // the voice sounds already and is excited again
  moves,    // the voice sounds on, maybe at another pitch (legato, pedal)
};

struct HeldKey {
  std::uint8_t key = 0;
  double velocity = 0.0;
  double frequency_hz = 0.0;  // 0: the key's own
};

// A held key to which a mono channel returns, and the effect on the latest voice.
struct ReturnedKey : HeldKey {
  Press press = Press::moves;
};

// The held keys of one channel in the order of pressing. A mono channel plays the last of them.
// All functions: [audio] wait-free, O(keys).
class HeldKeys {
 public:
  void press(int key, double velocity, double frequency_hz) {
    release(key);
    keys_[count_++] = {static_cast<std::uint8_t>(key), velocity, frequency_hz};
  }
  void release(int key) {
    const auto end = keys_.begin() + static_cast<std::ptrdiff_t>(count_);
    count_ = static_cast<std::size_t>(
        std::remove_if(keys_.begin(), end, [&](const HeldKey& held) { return held.key == key; }) -
        keys_.begin());
  }
  void clear() { count_ = 0; }
  bool is_empty() const { return count_ == 0; }
  std::optional<HeldKey> last() const {
    return count_ > 0 ? std::optional(keys_[count_ - 1]) : std::nullopt;
  }

 private:
  std::array<HeldKey, key_count> keys_{};
  std::size_t count_ = 0;
};

// `highest_factor` is the stiffness limit of Parameters. All functions but the constructor: [audio]
// wait-free, O(voices).
class Keyboard {
 public:
  // `outputs`: number of output channels; pan has no effect on one.
  Keyboard(const Playing& playing, double rate_hz, std::size_t outputs);
  // Takes over voices, channels and tuning of another engine of the same model.
  void continue_from(const Keyboard& from);
  // Takes over channels and tuning messages of an engine of another model.
  void adopt_channels(const Keyboard& from);
  // Called after continue_from() with new model numbers. The gain is 1/`gain_ratio` of the old
  // gain.
  void renumber(double gain_ratio);

  // --- keys ---
  // Starts the voice of a lane if it sleeps. Returns whether it did.
  bool wake(std::size_t lane);
  // `own_hz` above 0 is the note's frequency in place of the key's.
  Press press_key(int key, double velocity, std::uint8_t channel, double highest_factor,
                  double own_hz = 0.0);
  // Handles a released key on a mono channel: the previous held key sounds again. Returns that key;
  // nullopt if release_key() must handle the event instead.
  std::optional<ReturnedKey> return_to_held_key(int key, std::uint8_t channel,
                                                double highest_factor);
  // Handles a released key with release velocity 0..1. Returns whether the voice is released.
  bool release_key(Voice& voice, int key, std::uint8_t channel, double velocity) const;
  void release(Voice& voice) const;
  // Damps a voice that no key has started, like one whose key is released.
  void damp_keyless(Voice& voice) const;
  void forget_keys(ChannelMask channels);  // the keys count as not held
  // Fades all voices, and lifts all pedals and keys.
  void panic();
  void silence(std::uint8_t channel);

  // --- channels ---
  // Applies a controller to its channel and voices. After `sustain`, `sostenuto` and `zones` the
  // caller must release the voices for which is_released_by_pedal() is true.
  Channels::Change turn_controller(std::uint8_t channel, int number, double value);
  void bend(std::uint8_t channel, double amount);
  void reset_controllers(std::uint8_t channel);
  bool is_released_by_pedal(const Voice& voice, std::uint8_t channel) const;
  void set_mono(std::uint8_t channel, bool is_mono) { channels_.set_mono(channel, is_mono); }
  bool is_mono(std::uint8_t channel) const { return channels_.is_mono(channel, playing_.mono); }
  bool is_legato(std::uint8_t channel) const {
    return playing_.legato || channels_.is_legato(channel);
  }
  const Channels& channels() const { return channels_; }
  // Sets the velocity of a voice's strike, 0..1, for the curves of its parameters.
  void set_velocity(Voice& voice, double velocity);
  // Sets the pitch and the gain that LFOs add to a voice.
  void vibrate(Voice& voice, double semitones, double gain);
  // Sets a voice's gain by velocity: from 0 within `rise_s` if it starts, else within 20 ms.
  void set_strength(Voice& voice, double strength, double rise_s = 0.0) const;
  // Ramps the voice's output to its negative.
  void invert(Voice& voice) const;

  // --- addressing ---
  // Returns whether the voice is awake and in the scope. A released note of an MPE member channel
  // follows the master channel only, because its own channel may belong to another note by now.
  bool is_addressed(const Voice& voice, const Scope& scope) const;
  // Returns the lane in the scope that was played last; nullopt if there is none.
  std::optional<std::size_t> latest_of(const Scope& scope) const;

  // --- tuning ---
  // Sets the parameter of Playing::along, and retunes all awake voices if it has changed.
  void set_tuning_parameter(double value);
  void retune_key(std::size_t key, double frequency_hz, bool is_now, double highest_factor);
  void reset_tuning(double highest_factor);
  // Returns a voice's factor on every stiffness, even if its kernels do not know it yet.
  double factor_of(const Voice& voice, double highest_factor) const;
  double initial_factor(const Voice& voice) const { return tuning_.initial_factor(voice); }
  // Computes the factors of new and retuned voices, or of all awake ones.
  void update_factors(bool all, double highest_factor);

  Voices voices;

 private:
  struct Pitch {
    double hz = 0.0;      // 0: as the model is written
    double key_hz = 0.0;  // requested frequency, before the stability limit
    bool is_own = false;  // given by the note, not by the key
  };

  void start_voice(int key, std::uint8_t channel, const Pitch& pitch, bool glides);
  void attach(Voice& voice, int key, std::uint8_t channel, bool is_struck);
  Voice* latest_on(std::uint8_t channel);
  void hold(Voice& voice) const;
  Voice* replace_voices_of(int key, std::uint8_t channel, double velocity);
  void replace(Voice& voice) const;
  void replace_other_keys(int key, std::uint8_t channel);
  void move_to(Voice& voice, int key, double own_hz, bool glides, double highest_factor);
  void glide_from(Voice& voice, double frequency_hz) const;
  void damp(Voice& voice) const;
  void retune(std::uint8_t channel);
  SideGains level_of(const Voice& voice) const;
  bool is_for_all(const Scope& scope) const;
  // Calls use(voice) for the awake voices that a message to `channel` reaches.
  template <class Use>
  void for_each_reached(std::uint8_t channel, Use&& use);

  const Playing& playing_;
  double rate_hz_;
  // Notes are blows or plucks, which ring on. A bow's stroke or a held force ends with its key.
  bool rings_on_;
  bool is_stereo_;
  Channels channels_;
  VoiceTuning tuning_;
  std::array<HeldKeys, Channels::count> held_keys_;  // [channel]
  std::array<double, Channels::count> last_hz_{};    // [channel] of its last key; 0: none
  std::uint64_t turns_ = 0;                          // keys pressed so far
};

}  // namespace ressort::engine
