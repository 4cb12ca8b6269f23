// core/analysis/timbre: the spectrum of a linear model in closed form, from its modes, so that its
// timbre needs no sound. Pure. [any thread]
//
// A line a mode, where the transform of a frame has a few bins: centroid, spread, skewness,
// kurtosis and rolloff agree with those of the sound, of modes that lie some bins apart, as nearly
// as the bins that neighbours share allow (magnitudes: 1 % of the centroid and 5 % of the spread of
// five modes a bell has; powers a tenth of that). Slope, decrease, flatness, crest and entropy
// count frequencies, so they are other numbers for lines than for bins.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "core/analysis/timbre/descriptors.h"
#include "core/analysis/timbre/window.h"

namespace ressort::analysis {

// One motion of a linear model: residue * pole_radius^n at its frequency, n in samples.
struct DecayingPartial {
  double frequency_hz = 0.0;
  double pole_radius = 1.0;  // 1: nothing damps it
  double residue = 0.0;      // its amplitude at sample 0, of either sign
};

// What a mode of this T60 is multiplied by in a sample; infinity gives 1.
double pole_radius(double t60_s, double rate_hz);

// Which samples a frame has.
struct ModalFrame {
  Window window = Window::hann;
  std::size_t size = 2048;  // samples
  std::size_t at = 0;       // its first one
};

// The amplitude that each partial has in a frame: |residue| r^at |sum w[m] r^m| / sum w[m]. Those
// whose frequency is not above 0 and below half the rate are left out. O(partials)
std::vector<Partial> partials_in_frame(std::span<const DecayingPartial> partials,
                                       const ModalFrame& frame, double rate_hz);

// The shape of lines in ascending order of frequency; nothing of silence.
std::optional<SpectralShape> spectral_shape(std::span<const Partial> partials, SpectrumKind kind);

}  // namespace ressort::analysis
