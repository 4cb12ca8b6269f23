// core/identification: the modes of a thing that was struck once, from a recording of how it rings.
//
// Poles by ESPRIT in sub-bands, first for what rings long, then in what is left of the first
// moments for what is damped strongly, and once more in what is left of all; after each search
// every number is fitted anew to the whole sound. What does not rise out of the noise around it is
// taken back.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "core/identification/blow.h"
#include "core/progress.h"
#include "core/result.h"

namespace ressort::identification {

// A number and its standard deviation, as the noise that is left over says (Cramer-Rao).
struct Measured {
  double value = 0.0;
  double deviation = 0.0;
};

struct IdentifiedMode {
  Measured frequency_hz;  // of the damped swing
  Measured t60_s;
  // Of each channel: amplitude e^(-alpha t) cos(2 pi f t + phase) from the time 0 on.
  std::vector<Measured> amplitude;
  std::vector<Measured> phase_rad;  // -pi to pi
};

struct OctaveResidual {
  double low_hz = 0.0;
  double high_hz = 0.0;
  double level_db = 0.0;     // of the sound there, below all of it
  double residual_db = 0.0;  // of what the modes leave of that
};

struct IdentifyOptions {
  std::size_t most_modes = 400;  // of those with most energy
  double floor_db = -70.0;       // of a mode's energy, below that of the one with most
};

struct Identification {
  double rate_hz = 0.0;
  double onset_s = 0.0;      // the blow, from the recording's start
  double time_zero_s = 0.0;  // when one impulse would have had to come, so that all swing from 0
  double skipped_s = 0.0;    // after the onset: what is clipped, and the blow itself
  double analysed_s = 0.0;   // then
  std::vector<IdentifiedMode> modes;  // by frequency
  double residual_db = 0.0;           // of what the modes leave of the whole sound, constants aside
  std::vector<OctaveResidual> octaves;
  std::vector<std::string> warnings;          // of the recording, and of what was found
  std::vector<std::vector<double>> sound;     // what was looked at: from there on
  std::vector<std::vector<double>> residual;  // that, without the modes
};

// Above this a body has no modes at 44100 Hz, so nobody looks there.
inline constexpr double highest_mode_hz = 0.45 * 44100.0;

// An error where nothing can be found, or nothing rings. [any thread but audio]
Result<Identification> identify(const Recording& recording, const IdentifyOptions& options,
                                const Progress& progress);

}  // namespace ressort::identification
