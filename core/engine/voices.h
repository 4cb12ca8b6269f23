// core/engine: what an Engine is made of. Its own header, for engine.cpp and voices.cpp only.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <variant>
#include <vector>

#include "core/engine/bank.h"
#include "core/engine/energy.h"
#include "core/engine/engine.h"
#include "core/gesture.h"

namespace ressort {

inline constexpr double steal_fade_s = 0.005;  // a voice that gives way takes this long to vanish
inline constexpr double quiet_level = 1e-5;    // -100 dBFS
inline constexpr double silent_level = 1e-6;   // -120 dBFS: nothing that stands still was louder

struct Voice {
  bool awake = false;       // steps and is heard
  bool lost = false;        // its stability: it fades from where it was
  bool fading = false;      // gives way; its lane is free when the fade ends
  bool held = false;        // by a key
  bool sustained = false;   // by the pedal, its key being up
  bool is_new = false;      // its kernels are to be put to the start,
  bool is_retuned = false;  // or to its factor, before they step
  std::uint8_t key = 0;
  std::uint8_t channel = 0;
  double frequency_hz = 0.0;  // without bend; 0: as the model is written
  double factor = 1.0;        // on every stiffness
  double gain = 1.0;
  double gain_step = 0.0;  // per sample
  double next_gain(double now) const { return std::max(0.0, now + gain_step); }
  double peak = 0.0;   // of the network's output since the last update
  double level = 0.0;  // peak of the output, slowly forgotten
  std::size_t quiet_frames = 0;
};

// One part in one voice, and what is known of its energy.
struct Watch {
  bool is_still = false;   // is not stepped; its outputs are what they were
  bool is_stirred = true;  // something came from outside since the last look
  bool is_judged = false;  // `most` is known
  double most = 0.0;       // energy that it may have, as long as nothing stirs it
  // At the last look, and the one before:
  bool is_metered = false;
  double energy = 0.0;
  double loss = 0.0;         // of it in a sample between them, unless...
  bool is_driven = true;     // ...something came from outside then
  std::uint64_t looked = 0;  // Playback::updates
};

// A look at one part in one voice: as it was at one time, its energy added up a slice at a time.
struct Look {
  static constexpr std::size_t none = static_cast<std::size_t>(-1);
  std::size_t at = none;  // of the watches
  std::size_t done = 0;   // of its elements
  bool was_stirred = false;
  std::uint64_t updates = 0;  // when it was
  Energy energy;
};

// What an engine is in the midst of: all but its kernels and what they are driven by. Another
// engine of the same model goes on by a copy of it.
struct Playback {
  std::vector<Voice> voices;           // [lane]
  std::vector<InputDriver> drivers;    // [lane][input]
  std::vector<Watch> watches;          // [lane][part]
  std::vector<double> held;            // [lane][output of the machine] of what stands still
  std::vector<double> parameters;      // as they are now
  std::vector<std::uint16_t> changes;  // parameters, since the last take_changes()
  std::vector<double> rest;            // [input] where a new voice's driver starts
  std::vector<double> audio_before;    // [input]
  double bend = 0.0;
  std::array<bool, 16> pedal{};
  std::size_t last = 0;          // the lane that was played last: direct gestures act on it
  std::size_t since_update = 0;  // frames, below max_block_frames between two segments
  std::uint64_t updates = 0;     // times
  std::size_t still = 0;         // watches of what stands still
  EngineMeters metered;          // the energy, as read_energy() found it
  std::uint64_t resets = 0;
  std::uint64_t stolen = 0;
  std::uint64_t shed = 0;
  std::size_t most_voices = std::numeric_limits<std::size_t>::max();  // as limit_voices() said
  std::uint64_t beyond = 0;
  std::uint64_t noise = 0x9e3779b97f4a7c15u;
};

struct Engine::Voices : Playback {
  Voices(Machine machine_in, Playing playing_in, Precision precision, Isa isa,
         const Progress& progress);
  std::size_t lanes_wanted() const;
  Watch& watch(std::size_t lane, std::size_t part) {
    return watches[lane * elements.size() + part];
  }
  double* held_of(std::size_t lane, std::size_t part) {
    return held.data() + lane * first_output.back() + first_output[part];
  }

  // Calls `use(part)` for every PartBank.
  template <class Use>
  void each_part(Use&& use) {
    std::visit(
        [&](auto& b) {
          for (auto& part : b.parts) {
            use(part);
          }
        },
        bank);
  }

  // --- inputs ---
  double middle(std::size_t input) const;
  InputDriver& driver(std::size_t lane, std::size_t input) {
    return drivers[lane * machine.inputs.size() + input];
  }
  // What a gesture is to know of an input and of the control that asks for it, if one does.
  Stroke stroke_on(std::size_t input, const Control* control) const;
  // In the voice that was played last, or in all.
  void play(const GestureRow& gesture, std::size_t input, Stroke stroke);
  void perform(const Control& control, double amount);
  template <class Wanted>
  void perform_all(double amount, Wanted&& wanted);

  // --- parameters ---
  // The nearest value that the parameter may have.
  double within_limits(std::size_t index, double value) const;
  // The stiffness factor that the parameters, as they are, leave to keys and bend.
  double highest_factor() const;
  void set_parameter(std::size_t index, double wanted);
  void note_change(std::uint16_t index);
  // Something comes to a part from outside.
  void stir(std::size_t lane, std::size_t part);
  // From the next segment on it says what is in its kernel's row, [output][lane].
  template <class T>
  void lay_still(const T* row, std::size_t width, std::size_t lane, std::size_t part);
  void forget(Watch& here);
  template <class T>
  void set_coefficient(PartBank<T>& part, std::size_t lane, std::uint32_t c, bool ramped);
  template <class T>
  void set_coefficients(PartBank<T>& part, std::size_t lane, bool ramped);
  template <class T>
  void apply_changes(PartBank<T>& part, std::size_t p);
  // Brings the kernels to what the events before this segment want: once, however many they were.
  void apply_changes();
  double factor_for(std::size_t lane) const;  // on every stiffness, for its key and the bend
  double factor_of(std::size_t lane) const;   // the voice's, even if its kernels have yet to know
  void tune(std::size_t lane);

  // --- voices ---
  // Puts the lane to the model's start, tuned; 0 Hz: as the model is written.
  void start(std::size_t lane, double frequency_hz);
  void wake(std::size_t lane);
  void fade(std::size_t lane, double seconds);
  bool is_live(std::size_t lane) const { return voices[lane].awake && !voices[lane].fading; }
  std::size_t voices_allowed() const;
  void limit_voices(std::size_t most);
  // A lane for a new note: the same key's, a free one, or the quietest's place.
  std::size_t lane_for(int key, int channel);

  // --- events ---
  void handle(const Event& event);
  void note_on(const Event& event);
  // The key's frequency, brought by octaves to where the model is stable.
  double playable_hz(int key) const;
  void note_off(const Event& event);
  void release(std::size_t lane);
  void controller(const Event& event);
  void panic();
  const Control* control_for(int number, Gesture gesture) const;
  void press(double amount);
  void play_live(const Event& event);

  // --- taking over ---
  template <class T>
  void place_before(Bank<T>& b, PartBank<T>& part, std::size_t lane) const;
  template <class T>
  void go_on(Bank<T>& b, PartBank<T>& part, const PartBank<T>& from, std::size_t first);
  template <class T>
  void go_on(Bank<T>& b, const Bank<T>& from);
  bool go_on_from(const Voices& from);
  template <class T>
  bool can_be_left(Bank<T>& scratch, const PartBank<T>& part) const;

  // --- sound ---
  void segment(std::span<const double* const> inputs, std::span<double* const> outputs,
               std::size_t at, std::size_t frames);
  template <class T>
  void segment_in(Bank<T>& b, std::span<const double* const> inputs,
                  std::span<double* const> outputs, std::size_t at, std::size_t frames);
  bool is_silent(const double* audio, std::size_t frames) const;
  // Nobody is awake and nobody wakes: true if no sound comes in, and nothing is left to do.
  bool sleeps_through(std::span<const double* const> inputs, std::size_t at, std::size_t frames);
  // The buffers for the voices of one kernel, the first of which is `first`: what rests...
  template <class T>
  void fill_rest(Bank<T>& b, const PartBank<T>& part, std::size_t first, std::size_t frames);
  // ...and what moves.
  template <class T>
  void fill_drive(Bank<T>& b, std::size_t p, std::size_t first, std::size_t frames);
  // What depends on a parameter that audio gives, for every sample.
  template <class T>
  void fill_audio(Bank<T>& b, const PartBank<T>& part, std::size_t first,
                  std::span<const double* const> inputs, std::size_t at, std::size_t frames);
  // What comes in moves the hand from where it is; in the bare network it is the hand.
  double audio_scale(std::size_t input) const;
  const double* audio_for(std::size_t input, std::span<const double* const> inputs) const;
  // Sound at an audio input wakes the voice that it drives; silence is not looked at again.
  void listen(std::span<const double* const> inputs, std::size_t at, std::size_t frames);
  // The last position of an audio input, for the velocity of the next segment's first sample.
  void remember_audio(std::span<const double* const> inputs, std::size_t end);
  // What there is to do for the kernel of a part that begins with voice `first`. What is moved
  // from outside is not still any more.
  struct Pace {
    bool steps = false;   // there is somebody to step
    bool stands = false;  // and somebody who stands still
  };
  template <class T>
  Pace pace_of(const Bank<T>& b, std::size_t p, std::size_t first);
  template <class T>
  Pace pace_of_some(const Bank<T>& b, std::size_t p, std::size_t first);
  // Adds what the voices of one kernel say to the outputs, and keeps their last sample.
  template <class T>
  void mix(Bank<T>& b, std::size_t p, std::size_t first, std::span<double* const> outputs,
           std::size_t at, std::size_t frames);
  // The same of one voice, by itself.
  template <class T>
  void mix_some(const Bank<T>& b, std::size_t p, std::size_t lane, std::span<double* const> outputs,
                std::size_t at, std::size_t frames);
  // The last sample of what stands still, for frames [from, frames) of the segment.
  void mix_held(std::size_t p, std::size_t lane, std::span<double* const> outputs, std::size_t at,
                std::size_t from, std::size_t frames);
  void mix_still(std::size_t p, std::size_t first, std::size_t width,
                 std::span<double* const> outputs, std::size_t at, std::size_t frames);
  // A voice whose output has left its bounds is heard as long as it is sane; then it stands still
  // and, from the next segment on, fades.
  template <class T>
  void lose(Bank<T>& b, std::size_t p, std::size_t lane, std::span<double* const> outputs,
            std::size_t at, std::size_t frames);
  void fade_lost();

  // --- what watches the energy ---
  // Once in max_block_frames: looks at one part after the other, seldom enough for its cost to be
  // a small share of what stepping takes; at a large one for several times on end.
  void look_around();
  bool steps(std::size_t at) const;
  std::size_t price_of(std::size_t at) const;
  void look(std::size_t at);
  template <class T>
  void begin_look(Bank<T>& b, std::size_t at);
  template <class T>
  void go_on_looking(Bank<T>& b);
  template <class T>
  void judge(Bank<T>& b, const Look& seen);
  void enter(Watch& here, const Look& seen);
  void read_energy();
  template <class T>
  void accuse(const Program& program, LaneValues<T> values, const Bank<T>& b, std::size_t at);
  template <class T>
  bool may_rest(const Bank<T>& b, std::size_t lane, std::size_t p, double energy) const;
  double saved() const;

  // Keeps the voice's level and sends it to sleep when it has faded or come to rest. Once in
  // max_block_frames, counted from the engine's start: so what sleeps or gives way does not
  // depend on how the time is cut into blocks.
  void update(std::size_t lane);
  void update_all();
  // Whether nothing moves anywhere: a slow wave may still be on its way to the output.
  bool is_at_rest(std::size_t lane) const;
  // Uniform in -1..1: xorshift, from a fixed seed so that a render repeats.
  double white();

  Machine machine;
  Playing playing;
  std::variant<Bank<float>, Bank<double>> bank;
  std::vector<std::uint16_t> told;            // what the last take_changes() gave
  std::vector<const Control*> audio_control;  // [input] null where no audio drives it
  std::vector<const double*> sound;           // [input] of this segment; null where all is silent
  std::vector<std::size_t> first_output;      // [part] among all parts' outputs; then their number
  std::vector<std::size_t> elements;          // [part] nodes and links
  std::vector<std::uint32_t> creators;        // links that made energy of nothing, by origin
  std::size_t creators_told = 0;
  bool has_changed = false;           // something is to be applied
  std::vector<std::uint16_t> turned;  // parameters, since the last segment
  std::vector<bool> is_turned;        // [parameter]
  double highest_before = 1.0;        // highest_factor() before the first of them
  Look looking;                       // b.x and b.v are its own until it is done
  static constexpr std::size_t none = Look::none;
  std::size_t suspect = none;  // of the watches: is looked at more often, as something was created
  std::size_t looks_left = 0;  // at it
  std::size_t turn = 0;        // of the watches: the next to be looked at
  std::size_t looks_due = 0;   // updates, times watches: what looks are paid with
  bool is_idle = false;        // nobody is awake
  bool has_lost = false;       // a voice its stability, in this segment
  double loudest = 0.0;        // what no output reaches
  double level_kept = 0.0;     // of a voice's level from one update to the next
};

}  // namespace ressort
