// app/control: events of a note given by key, by frequency or by ID. The arguments are those of the
// registry's rows. [any thread but audio]
#pragma once

#include "app/control/registry.h"

namespace ressort::control::events {

Events note_on(const PlayCall& call);        // KEY VELOCITY ID; ID 0: none.
Events note_off(const PlayCall& call);       // KEY VELOCITY ID.
Events note_hz(const PlayCall& call);        // ID HZ VELOCITY
Events note_end(const PlayCall& call);       // ID
Events note_bend(const PlayCall& call);      // ID SEMITONES
Events note_pressure(const PlayCall& call);  // ID VALUE
Events note_slide(const PlayCall& call);     // ID VALUE

}  // namespace ressort::control::events
