// tests: a tuner. Measures the pitch of every key from the sound only.
#pragma once

#include <string>

#include "tests/bench/voicing/player.h"

namespace ressort::voicing {

// Measures keys 21 to 108 where they sound, and prints those that are not 100 cents above their
// neighbour (within 5, by YIN of the sound or of its strongest partial) or whose partials are off
// the key (by more than 3, weighted by their power, less the stretch of a stiff string). Returns
// their number.
int check_semitones(Player& player, const std::string& name);

}  // namespace ressort::voicing
