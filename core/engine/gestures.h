// core/engine: the gestures: what drives the inputs of every voice, and what the preset's controls
// and live calls make of it.
#pragma once

#include <cstddef>
#include <vector>

#include "core/engine/energy_watch.h"
#include "core/engine/event.h"
#include "core/engine/mixing/bank.h"
#include "core/engine/parameters.h"
#include "core/engine/voices.h"
#include "core/gesture.h"

namespace ressort::engine {

// A gesture wakes the voices that it plays, and may turn parameters. All functions but the
// constructor: [audio] wait-free.
class Gestures {
 public:
  Gestures(const Machine& machine, const Playing& playing, Voices& voices, Parameters& parameters);
  void go_on_from(const Gestures& from);

  // The drivers of a voice that starts: to where gestures begin.
  void place(std::size_t lane);
  // A voice that slept starts, with its hands where this channel has them.
  void wake(std::size_t lane, std::uint8_t channel = 0);
  bool is_moving(std::size_t lane, std::size_t input) const {
    return drivers_[lane * machine_.inputs.size() + input].is_moving();
  }
  bool is_moving(std::size_t lane) const;
  bool is_drawn(std::size_t lane) const;

  // What the controls of this source, of this key or of this controller's number, do for 0..1. What
  // has a goal moves in all voices that are meant, all else in the last of them; parameters are
  // turned for everybody. O(controls * voices)
  void perform(Source source, int number, double amount, const Scope& scope = {});
  void perform(const Control& control, double amount, const Scope& scope = {});
  // What a note does that another engine plays (NoteShare): to all voices, and to the next.
  void perform_elsewhere(int key, double amount, std::uint8_t channel);
  Scope of_last() const { return {.channels = channel_bit(voices_[voices_.last()].channel)}; }
  // Of EventKind::gesture.
  void perform_live(const Event& event);
  // What a key does when it is released, in its voice.
  void release(std::size_t lane);
  // Voices have another pitch: what is drawn across them moves at the same speed in units of their
  // own motion, so that a bow that is bent or glides goes on to catch its string.
  void follow_pitches();

  // Where the drivers are before a segment, in the bank's row.
  struct Rest {
    bool is_any_moving = false;  // of a voice that is awake
    bool is_alike = true;        // none of these, and all lanes are in the same place
  };
  template <class T>
  Rest rest(Bank<T>& bank, const VoiceGroup& group) const;
  // After it: where they are in each frame.
  template <class T>
  void fill(Bank<T>& bank, const VoiceGroup& group, std::size_t frames, const Rest& rest,
            EnergyWatch& watch);

 private:
  InputDriver& driver(std::size_t lane, std::size_t input) {
    return drivers_[lane * machine_.inputs.size() + input];
  }
  const InputDriver& driver(std::size_t lane, std::size_t input) const {
    return drivers_[lane * machine_.inputs.size() + input];
  }
  // With what a gesture is to know of the input.
  Stroke on_input(std::size_t input, Stroke stroke) const;
  void play(const GestureRow& gesture, std::size_t input, Stroke stroke, const Scope& scope);
  void set_pitch(std::size_t lane, double pitch);
  // Where the drivers of new voices on these channels start.
  void set_starts(ChannelMask channels, std::size_t input, double start);
  template <class T>
  static void fill_rest(Bank<T>& bank, const PartBank<T>& part, std::size_t frames);

  const Machine& machine_;
  const Playing& playing_;
  Voices& voices_;
  Parameters& parameters_;
  std::vector<InputDriver> drivers_;  // [lane][input]
  std::vector<double> pitches_;       // [lane] to that of the model, for which they move
  std::vector<double> starts_;        // [channel][input] where a new voice's driver is
  std::uint64_t strokes_ = 0;         // notes that were played: whose turn it is
};

}  // namespace ressort::engine
