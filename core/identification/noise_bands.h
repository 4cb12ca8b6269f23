// core/identification: describes what does not ring in a recording by bands of decaying noise.
#pragma once

#include <cstddef>
#include <vector>

#include "core/identification/identify.h"

namespace ressort::identification {

// Noise in one band that decays exponentially.
struct NoiseBand {
  double low_hz = 0.0;
  double high_hz = 0.0;
  double t60_s = 0.0;         // Decay from its loudest moment on.
  std::vector<double> level;  // [channel] Rms at the start of the decay.
};

// Describes the residual of an identification. A band has the energy of the residual there. Bands
// that hold less than a millionth of the sound are left out. [any thread but audio]
std::vector<NoiseBand> noise_bands(const Identification& found);

// Returns `frames` samples of each channel of this noise, the same each time. All channels have the
// same noise at their own level, as in a model. [any thread but audio]
std::vector<std::vector<double>> sound_of(const std::vector<NoiseBand>& bands, std::size_t channels,
                                          std::size_t frames, double rate_hz);

}  // namespace ressort::identification
