// app/session: modes of a scene, as JSON and as a table, cached on disk.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/session/loader.h"
#include "core/analysis/modes/modes.h"
#include "core/result.h"

namespace ressort::session {

struct KnownMode {
  double frequency_hz = 0.0;
  double t60_s = 0.0;                       // infinity: undamped
  std::vector<std::vector<double>> levels;  // [input][output], like NetworkMode
};

struct KnownModes {
  std::vector<KnownMode> modes;     // in ascending order of frequency
  std::vector<std::string> inputs;  // such as "in1"
  std::vector<std::string> outputs;
  std::size_t masses = 0;  // moving masses
  bool is_all = true;      // false: only the lowest modes
  bool is_linear = true;   // false: linearised at rest
  ModeScheme scheme = ModeScheme::published;
  double rate_hz = 0.0;
  double residual = 0.0;
};

// Returns the start values of a scene's parameters. [parameter]
std::vector<double> start_values(const Scene& scene);

// Converts the result of a search.
KnownModes known_modes(const NetworkModes& found);

// Returns the modes of the scene's network with these parameters. Takes them from the user's cache
// if the same version has found them for the same network; otherwise finds them, and caches them if
// that took long. Blocks. [any thread but audio]
Result<KnownModes> known_modes(const Scene& scene, const std::vector<double>& parameters,
                               const ModeOptions& options);

// Returns {"modes": [{"frequency_hz": ..., "t60_s": ..., "levels": [[...]]}], ...}. The T60 of an
// undamped mode is null.
std::string to_json(const KnownModes& modes);

// Returns a table of frequency, note and cents, T60 and levels, in dB relative to the loudest mode
// of each column.
std::string to_table(const KnownModes& modes);

// Returns the nearest note at A4 = 440 Hz and the deviation in cents: "A4 +3".
std::string note_name(double frequency_hz);

// Parses "A4", "Bb2", "C#5" or a positive number of Hz; nothing for any other text.
std::optional<double> frequency_of(const std::string& text);

}  // namespace ressort::session
