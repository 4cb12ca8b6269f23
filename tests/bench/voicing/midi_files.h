// tests: plays MIDI files through a preset as a device does.
#pragma once

#include <string>
#include <vector>

namespace ressort::voicing {

void print_midi_head();

// Plays each file, with all of its channels, through the preset on one core at 48 kHz, and prints a
// row for each file and one for all of them. `seconds` ends a file early; 0: never. Returns the
// number of broken promises: a loudness out of bounds, a voice that has not ended 30 s after the
// file, a voice shed because the core is too slow, a voice that became unstable, a message that was
// not understood.
int play_midi_files(const std::string& preset, const std::vector<std::string>& files,
                    double seconds);

}  // namespace ressort::voicing
