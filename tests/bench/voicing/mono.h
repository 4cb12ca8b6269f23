// tests: measures the change from one key to another in mono mode.
#pragma once

#include <string>

#include "tests/bench/voicing/player.h"

namespace ressort::voicing {

// Plays pairs of keys in mono mode: struck, with portamento and legato. Plays them in poly mode
// with the first one bent. The pairs lie on both sides of every key at which another control
// begins. Struck and plucked presets also leap up to four octaves. Prints the highest peak relative
// to that of the same blows in poly mode. Returns 1 if it is more than 3 dB higher.
int check_mono(Player& player, const std::string& name);

}  // namespace ressort::voicing
