// core/engine: the only thing that crosses from any input to the engine. Small, trivially
// copyable; a gesture is a list of these.
#pragma once

#include <cstdint>

#include "core/gesture.h"
#include "core/rooms.h"

namespace ressort::engine {

enum class EventKind : std::uint8_t {
  note_on,       // index: key 0..127, value: velocity 0..1 (above 0), may be fractional; value2: Hz
                 // in place of the key's, 0: the key's
  note_off,      // index: key, value: how fast it goes up, 0..1
  controller,    // index: MIDI controller number, value: 0..1
  program,       // index: MIDI program number; for whoever loads, no engine takes it
  pressure,      // of the whole channel, value: 0..1
  key_pressure,  // index: key, value: 0..1
  bend,          // value: -1..1 of the bend range
  custom,        // index: row of the control map (an OSC address of the preset), value: 0..1
  parameter,     // index: parameter, value: as in the model
  key_tuning,  // index: key, value: Hz before transposition, 0: silent; value2: 1: what sounds, too
  tuning_reset,  // every key as the preset has it, what sounds, too
  gesture,       // index: input number, value and value2: the gesture's arguments
  strike,        // value: the force on a mass, for one sample at 44 100 Hz; value2: which mass of
                 // the network with its macros written out
  panic,         // everything fades to silence at once
};

// Of a key that goes up and does not say how fast.
inline constexpr double usual_release_velocity = 0.5;

struct Event {
  std::uint32_t frame = 0;  // within the block that it is given with
  EventKind kind = EventKind::panic;
  Gesture gesture = Gesture::position;  // of EventKind::gesture
  std::uint8_t channel = 0;  // MIDI channel 0..15, or that of a note's ID: note_channel()
  std::uint16_t index = 0;
  std::uint32_t model = 0;  // serial of the model that `index` belongs to; 0: any
  double value = 0.0;
  double value2 = 0.0;
};

}  // namespace ressort::engine
