// tests: whether every position of every control of a preset is music.
#pragma once

#include <cstdint>
#include <string>

#include "tests/bench/voicing/player.h"

namespace ressort::voicing {

// Plays a note at each of `count` random settings of all controls, bend and pedals, with a lever
// that moves in the midst of it; prints what is wrong with which, the first of each kind, and a
// line of figures. Returns how many settings fail in any way.
int play_random_settings(Player& player, const std::string& name, int count, std::uint64_t seed);

}  // namespace ressort::voicing
