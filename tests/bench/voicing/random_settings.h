// tests: checks that every setting of a preset's controls makes a usable sound.
#pragma once

#include <cstdint>
#include <string>

#include "tests/bench/voicing/player.h"

namespace ressort::voicing {

// Plays a note at each of `count` random settings of all controls, pitch bend and pedals, and moves
// one lever during the note. Prints the first fault of each kind and a line of figures. Returns the
// number of settings with faults.
int play_random_settings(Player& player, const std::string& name, int count, std::uint64_t seed);

}  // namespace ressort::voicing
