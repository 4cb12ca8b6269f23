// app/session: the modes of a scene as people and programs read them, kept for the next time.
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
  double t60_s = 0.0;                       // infinity: nothing damps it
  std::vector<std::vector<double>> levels;  // [input][output], as of NetworkMode
};

struct KnownModes {
  std::vector<KnownMode> modes;     // by frequency
  std::vector<std::string> inputs;  // "in1"
  std::vector<std::string> outputs;
  std::size_t masses = 0;  // that move
  bool is_all = true;      // else the lowest
  bool is_linear = true;   // else as it is at rest
  ModeScheme scheme = ModeScheme::published;
  double rate_hz = 0.0;
  double residual = 0.0;
};

// What the parameters of a scene are as it starts. [parameter]
std::vector<double> start_values(const Scene& scene);

// The same of a search's result.
KnownModes known_modes(const NetworkModes& found);

// Of the scene's network with these parameters: as they were found before, for the same network by
// the same version, in the user's cache; else they are found, and kept where that took a while.
// Blocks. [any thread but audio]
Result<KnownModes> known_modes(const Scene& scene, const std::vector<double>& parameters,
                               const ModeOptions& options);

// {"modes": [{"frequency_hz": ..., "t60_s": ..., "levels": [[...]]}], ...}; a T60 that is none is
// null.
std::string to_json(const KnownModes& modes);

// A table for people: frequency, note and cents, T60 and levels, in dB below the loudest of each
// column.
std::string to_table(const KnownModes& modes);

// "A4 +3": the nearest note of A4 = 440 Hz and how many cents it is from there.
std::string note_name(double frequency_hz);

// Of "A4", "Bb2", "C#5" or a number of Hz above 0; nothing for any other text.
std::optional<double> frequency_of(const std::string& text);

}  // namespace ressort::session
