// tests: measures the rounding errors of presets in single precision.
#pragma once

#include <string>

namespace ressort::voicing {

// Plays notes of forte in single and in double precision, and prints the greatest difference in
// their first quarter of a second, relative to the peak. Returns 1 if a preset that asks for single
// precision differs by more than -80 dB. Throws std::runtime_error if it cannot be loaded.
int check_rounding(const std::string& name, double rate_hz);

}  // namespace ressort::voicing
