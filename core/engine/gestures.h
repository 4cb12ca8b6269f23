// core/engine: the gestures of all voices: controls and live calls move the drivers of inputs.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/engine/bank.h"
#include "core/engine/energy_watch.h"
#include "core/engine/event.h"
#include "core/engine/keyboard.h"
#include "core/engine/parameters.h"
#include "core/gesture.h"

namespace ressort::engine {

// A gesture wakes the voices that it plays, and may change parameters. All functions but the
// constructor: [audio] wait-free.
class Gestures {
 public:
  Gestures(const Machine& machine, const Playing& playing);
  void continue_from(const Gestures& from);

  // Puts the drivers of a starting voice to their initial positions.
  void reset_drivers(const Voice& voice, std::size_t lane);
  // Starts a sleeping voice with the driver positions of this channel.
  void wake(Keyboard& keyboard, std::size_t lane, std::uint8_t channel = 0);
  bool is_moving(std::size_t lane, std::size_t input) const {
    return driver(lane, input).is_moving();
  }
  bool is_any_moving(std::size_t lane) const {
    return std::ranges::any_of(drivers_of(lane), &InputDriver::is_moving);
  }
  bool is_any_bowed(std::size_t lane) const {
    return std::ranges::any_of(drivers_of(lane), &InputDriver::is_drawn);
  }

  // Plays all controls of this source that match the key or the controller number, with an amount
  // 0..1. A gesture with a goal moves in all voices of the scope, any other in `lane`, by default
  // the latest of them.
  // Parameters change for all voices. O(controls * voices)
  void play(Source source, int number, double amount, const Scope& scope, Keyboard& keyboard,
            Parameters& parameters);
  void play(const Control& control, double amount, const Scope& scope, Keyboard& keyboard,
            Parameters& parameters, double key = middle_c,
            std::optional<std::size_t> lane = std::nullopt);
  // Follows a note that another engine plays (NoteShare). Gestures that move all voices are played;
  // of the others only the position is kept at which the next one starts.
  void follow_other_engine(int key, double amount, std::uint8_t channel, Keyboard& keyboard,
                           Parameters& parameters);
  // Handles EventKind::gesture.
  void play_live(const Event& event, Keyboard& keyboard, Parameters& parameters);
  // Ends the gestures of a voice's key when it is released.
  void end(const Voice& voice, std::size_t lane);
  // Plays the release controls of a voice's key, with its release velocity.
  void play_release(std::size_t lane, Keyboard& keyboard, Parameters& parameters);
  // Adapts the speed of bows to the new pitch of retuned voices. In units of the string's motion
  // the speed stays the same, so that a bent or gliding bow keeps its grip.
  void follow_pitch_changes(const Voices& voices);

  // Writes the drivers' positions before a segment to bank.held->row.
  struct RowState {
    bool is_any_moving = false;  // motion in an awake voice
    bool is_uniform = true;      // nothing moves, and all lanes have the same positions
  };
  template <class T>
  RowState write_row(Bank<T>& bank, const VoiceGroup& group, const Voices& voices) const;
  // Writes the drivers' positions and velocities in each frame of a segment. Called after
  // write_row().
  template <class T>
  void fill_inputs(Bank<T>& bank, const VoiceGroup& group, std::size_t frames,
                   const RowState& row_state, const Voices& voices, EnergyWatch& watch);

 private:
  InputDriver& driver(std::size_t lane, std::size_t input) {
    return drivers_[lane * machine_.inputs.size() + input];
  }
  const InputDriver& driver(std::size_t lane, std::size_t input) const {
    return drivers_[lane * machine_.inputs.size() + input];
  }
  std::span<const InputDriver> drivers_of(std::size_t lane) const {
    return std::span(drivers_).subspan(lane * machine_.inputs.size(), machine_.inputs.size());
  }
  Stroke stroke_on(std::size_t input, Stroke stroke) const;
  void play(const GestureRow& gesture, std::size_t input, Stroke stroke, const Scope& scope,
            std::optional<std::size_t> lane, Keyboard& keyboard, Parameters& parameters);
  std::uint64_t seed_of(const Voice& voice, std::size_t input) const;
  void set_pitch(std::size_t lane, double pitch);
  void set_starts(ChannelMask channels, std::size_t input, double start);
  template <class T>
  static void fill_constant(Bank<T>& bank, const PartBank<T>& part, std::size_t frames);

  const Machine& machine_;
  const Playing& playing_;
  std::vector<InputDriver> drivers_;  // [lane][input]
  std::vector<double> pitches_;  // [lane] ratio to the written pitch, for which bow speeds are set
  std::vector<bool> keeps_speed_;  // [input] bows there do not follow the pitch
  std::vector<double> starts_;     // [channel][input] initial position of a new voice's driver
  std::uint64_t strokes_ = 0;      // notes played so far, for round robins
};

}  // namespace ressort::engine
