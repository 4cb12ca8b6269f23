// app/commands: figures of a sound, measured from its samples alone. Pure.
#pragma once

#include <optional>
#include <vector>

#include "app/session/sound_file.h"
#include "core/result.h"

namespace ressort::commands {

// A time span of a sound, clipped to its length.
struct Stretch {
  double from_s = 0.0;
  double to_s = 0.0;
};

inline constexpr double silence_db = -200.0;  // lowest level, also of silence

double to_dbfs(double amplitude);

// Returns the magnitude of the largest sample.
double peak_of(const Sound& sound);

// Returns the integrated loudness of the whole sound (ITU-R BS.1770-4, EBU R 128). Fails where
// libebur128 does not support the rate or has no memory.
Result<double> loudness_lufs(const Sound& sound);

// Returns the levels of consecutive windows of `step_s`: the mean square of all channels, in dB.
std::vector<double> levels_db(const Sound& sound, Stretch stretch, double step_s);

// Returns the time from the start of the stretch until the level of 5 ms is first within 6 dB of
// the highest. Empty for silence.
std::optional<double> attack_ms(const Sound& sound, Stretch stretch);

// Returns the time of a decay by 60 dB, from a least-squares line through the levels of 10 ms, from
// the highest to 40 dB below it or to the end of the stretch. Empty where the level falls by less
// than 3 dB.
std::optional<double> t60_s(const Sound& sound, Stretch stretch);

}  // namespace ressort::commands
