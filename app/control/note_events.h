// app/control: the events of a note that is said by key, by frequency or by its ID. The arguments
// are those of the registry's rows. [any thread but audio]
#pragma once

#include "app/control/registry.h"

namespace ressort::control::events {

Events note_on(const Said& said);        // KEY VELOCITY ID, which is 0 for none
Events note_off(const Said& said);       // the same
Events note_hz(const Said& said);        // ID HZ VELOCITY
Events note_end(const Said& said);       // ID
Events note_bend(const Said& said);      // ID SEMITONES
Events note_pressure(const Said& said);  // ID VALUE
Events note_slide(const Said& said);     // ID VALUE

}  // namespace ressort::control::events
