// tests: measures what presets cost as they are played.
#pragma once

#include <string>
#include <vector>

namespace ressort::voicing {

// Prints a table: the processor time that each preset takes at 48 kHz, as a share of one core, for
// no voice, one voice, all voices, all voices struck ten times a second, all voices on the lowest
// and on the highest keys, and all voices in single precision; then the plan's prediction and, for
// the published models, FAUST's. Each is the median of `turns` measurements, taken in turn.
// Returns the number of presets that cannot be played.
int print_played(const std::vector<std::string>& names, int turns);

}  // namespace ressort::voicing
