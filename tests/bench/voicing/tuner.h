// tests: a tuner. Measures the pitch of every key from the sound only.
#pragma once

#include <string>

#include "tests/bench/voicing/player.h"

namespace ressort::voicing {

// Measures every semitone of the presets' common range, and prints the preset's keys whose distance
// to their lower neighbour is not 100 cents by YIN. Also prints the deviation of the partials
// weighted by their power. Returns the number of such keys.
int check_semitones(Player& player, const std::string& name);

}  // namespace ressort::voicing
