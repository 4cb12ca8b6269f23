// core/identification: finds the modes of an object from a recording of one blow.
//
// ESPRIT in sub-bands finds the poles in three passes: first the long-ringing ones, then the
// strongly damped ones in the residual of the first moments, then once more in the residual of the
// whole sound. After each pass all numbers are fitted again to the whole sound. Modes that explain
// no more than the surrounding noise would are removed.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "core/identification/blow.h"
#include "core/identification/glide.h"
#include "core/progress.h"
#include "core/result.h"

namespace ressort::identification {

// A value and its standard deviation, from the Cramer-Rao bound at the residual's noise level.
struct Measured {
  double value = 0.0;
  double deviation = 0.0;
};

struct IdentifiedMode {
  Measured frequency_hz;  // Frequency of the damped oscillation.
  Measured t60_s;
  // [channel] The mode is amplitude e^(-alpha t) cos(2 pi f t + phase) from time 0 on.
  std::vector<Measured> amplitude;
  std::vector<Measured> phase_rad;  // -pi to pi
};

// All pitches start this many cents high. The cents fall by the factor e in each `decay_s`.
struct FallingPitch {
  Measured cents;  // 0: the pitch does not fall.
  Measured decay_s;
};

struct OctaveResidual {
  double low_hz = 0.0;
  double high_hz = 0.0;
  double level_db = 0.0;  // Level of the sound in this band, relative to the whole sound.
  // Level of the band after subtraction of the modes, relative to `level_db`.
  double residual_db = 0.0;
};

// Energy that the best `modes` modes leave unexplained, relative to the sound.
struct Unexplained {
  std::size_t modes = 0;
  double residual_db = 0.0;
};

struct IdentifyOptions {
  std::size_t most_modes = 150;  // Keeps this many modes, those that explain the most together.
  std::size_t least_modes = 0;   // Keeps this many modes, even those that noise could explain.
  double floor_db = -70.0;       // Lowest energy of a mode, relative to the strongest one.
};

struct Identification {
  double rate_hz = 0.0;
  double onset_s = 0.0;      // Time of the blow, from the start of the recording.
  double time_zero_s = 0.0;  // Time of the single impulse that would set all modes going from 0.
  double skipped_s = 0.0;   // Time skipped after the onset: clipped samples and the contact itself.
  double analysed_s = 0.0;  // Length of the analysed sound after that.
  FallingPitch fall;        // Of all modes, from the first analysed sample on.
  std::vector<IdentifiedMode> modes;  // Sorted by ascending frequency, after the fall.
  // Energy that the modes leave unexplained, relative to the sound, constants excluded.
  double residual_db = 0.0;
  std::vector<Unexplained> choices;  // The same for 5, 10, 20 and 40 modes, if there are so many.
  std::vector<OctaveResidual> octaves;
  std::vector<std::string> warnings;          // Warnings about the recording and the result.
  std::vector<std::vector<double>> sound;     // The analysed sound.
  std::vector<std::vector<double>> residual;  // The analysed sound minus the modes.
  // [recording][mode] Displacement at the struck place of each recording of several, relative to
  // the one that the other members describe. Empty: there is one recording.
  std::vector<std::vector<double>> hits;
};

// A body cannot have modes above this frequency at 44,100 Hz, so the search ends here.
inline constexpr double highest_mode_hz = 0.45 * 44100.0;

// Identifies the modes. Returns an error if no blow is found or nothing rings. [any thread but
// audio]
Result<Identification> identify(const Recording& recording, const IdentifyOptions& options,
                                const Progress& progress);

// Identifies the modes of several recordings of one object with the same rate and number of
// channels, such as a soft blow, a loud one and one at the edge. All have the same poles; the
// shortest recording limits their length. Describes the recording with the most energy. [any
// thread but audio]
Result<Identification> identify_together(std::span<const Recording> recordings,
                                         const IdentifyOptions& options, const Progress& progress);

}  // namespace ressort::identification
