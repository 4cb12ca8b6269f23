// tests: measures a soft strike on a note that still rings.
#pragma once

#include <string>

#include "tests/bench/voicing/player.h"

namespace ressort::voicing {

// Plays a loud note, and then the same key softly, under the pedal at three times and with the key
// pressed again. Prints the lowest level after the soft strike, relative to the loud note alone.
// Returns the number of levels that are more than 1 dB lower. Skips bowed presets, whose second
// note is a new stroke, and noise, whose level is random.
int check_restrikes(Player& player, const std::string& name, int key);

}  // namespace ressort::voicing
