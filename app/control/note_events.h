// app/control: events of a note given by key, by frequency or by ID. The arguments are those of the
// registry's rows. [any thread but audio]
#pragma once

#include "app/control/registry.h"

namespace ressort::control::events {

Events note_on(const Said& said);        // KEY VELOCITY ID; ID 0: none.
Events note_off(const Said& said);       // KEY VELOCITY ID.
Events note_hz(const Said& said);        // ID HZ VELOCITY
Events note_end(const Said& said);       // ID
Events note_bend(const Said& said);      // ID SEMITONES
Events note_pressure(const Said& said);  // ID VALUE
Events note_slide(const Said& said);     // ID VALUE

}  // namespace ressort::control::events
