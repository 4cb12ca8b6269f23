// core: controller numbers of MIDI 1.0.
#pragma once

namespace ressort {

// A file takes the names with `using enum MidiNumber::Controller;`.
struct MidiNumber {
  enum Controller : int {
    portamento_time = 5,
    data_entry = 6,
    volume = 7,
    pan = 10,
    expression = 11,
    first_low_half = 32,  // of controller 0
    data_entry_fine = 38,
    sustain_pedal = 64,
    portamento_switch = 65,
    sostenuto_pedal = 66,
    soft_pedal = 67,
    legato_switch = 68,
    data_increment = 96,
    data_decrement = 97,
    unregistered_fine = 98,
    unregistered_coarse = 99,
    registered_fine = 100,
    registered_coarse = 101,
    all_sound_off = 120,
    reset_all_controllers = 121,  // also lifts the pedals
    local_control = 122,
    all_notes_off = 123,  // implied by the channel modes from here on
    mono_on = 126,
    poly_on = 127,
  };
};

}  // namespace ressort
