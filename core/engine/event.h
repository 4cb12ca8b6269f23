// core/engine: the only thing that crosses from any input to the engine. Small, trivially
// copyable; a gesture is a list of these.
#pragma once

#include <cstdint>

namespace ressort {

enum class EventKind : std::uint8_t {
  note_on,       // index: key 0..127, value: velocity 0..1 (above 0), may be fractional
  note_off,      // index: key
  controller,    // index: MIDI controller number, value: 0..1
  pressure,      // of the whole channel, value: 0..1
  key_pressure,  // index: key, value: 0..1
  bend,          // value: -1..1 of the bend range
  custom,        // index: row of the control map (an OSC address of the preset), value: 0..1
  parameter,     // index: parameter, value: as in the model
  position,      // index: input number, value: position
  force,         // index: input number, value: force, value2: seconds it lasts; 0: one sample
  pluck,         // index: input number, value: strength 0..1
  bow,  // index: input number, value: speed -1..1 of the bow's range, value2: pressure 0..1, below
        // 0: as it is
  panic,  // everything fades to silence at once
};

struct Event {
  std::uint32_t frame = 0;  // within the block that it is given with
  EventKind kind = EventKind::panic;
  std::uint8_t channel = 0;  // MIDI channel 0..15
  std::uint16_t index = 0;
  std::uint32_t model = 0;  // serial of the model that `index` belongs to; 0: any
  double value = 0.0;
  double value2 = 0.0;
};

}  // namespace ressort
