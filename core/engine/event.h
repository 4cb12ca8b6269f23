// core/engine: events, the only input of the engine besides audio. Small and trivially copyable.
#pragma once

#include <cstdint>

#include "core/gesture.h"
#include "core/rooms.h"

namespace ressort::engine {

enum class EventKind : std::uint8_t {
  note_on,       // index: key 0..127, value: velocity 0..1 (above 0); value2: frequency in Hz in
                 // place of the key's, 0: the key's
  note_off,      // index: key, value: release velocity 0..1
  controller,    // index: MIDI controller number, value: 0..1
  program,       // index: MIDI program number; handled by the loader, ignored by engines
  pressure,      // pressure of the channel, value: 0..1
  key_pressure,  // index: key, value: 0..1
  bend,          // value: -1..1, times the bend range
  custom,        // index: row of the control map (an OSC address of the preset), value: 0..1
  parameter,     // index: parameter, value: as in the model
  key_tuning,    // index: key, value: Hz before transposition, 0: silent; value2: 1 also retunes
                 // sounding voices
  tuning_reset,  // restores the preset's tuning, of sounding voices too
  gesture,       // index: input number, value and value2: the gesture's arguments
  strike,        // value: force for one sample at 44 100 Hz; value2: index of the mass in the
                 // network with expanded macros
  tempo,         // value: beats per second of a clock, for LFOs in beats
  clock,  // a tick of a MIDI clock, of 24 in a beat; the audio thread converts it to a tempo,
          // and engines ignore it
  panic,  // fades all voices to silence
};

// Release velocity of a note-off that does not specify one.
inline constexpr double usual_release_velocity = 0.5;

struct Event {
  std::uint32_t frame = 0;  // within the block
  EventKind kind = EventKind::panic;
  Gesture gesture = Gesture::position;  // gesture of EventKind::gesture
  std::uint8_t channel = 0;             // MIDI channel 0..15, or note_channel() of a note's ID
  std::uint16_t index = 0;
  std::uint32_t model = 0;  // serial number of the model that `index` refers to; 0: any
  double value = 0.0;
  double value2 = 0.0;
};

}  // namespace ressort::engine
