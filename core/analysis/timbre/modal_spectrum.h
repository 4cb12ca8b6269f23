// core/analysis/timbre: the spectrum of a linear model in closed form from its modes, without
// synthesising the sound. Pure. [any thread]
//
// Each mode is one line, where a Fourier transform has a few bins. Centroid, spread, skewness,
// kurtosis and rolloff agree with those of the sound if the modes are several bins apart (for five
// modes of a bell: magnitudes 1 % of the centroid and 5 % of the spread; powers a tenth of that).
// Slope, decrease, flatness, crest and entropy depend on the number of frequencies, so their values
// for lines and for bins differ.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "core/analysis/timbre/descriptors.h"
#include "core/analysis/timbre/window.h"

namespace ressort::analysis {

// One mode of a linear model: residue * pole_radius^n at its frequency, n in samples.
struct DecayingPartial {
  double frequency_hz = 0.0;
  double pole_radius = 1.0;  // 1 if undamped.
  double residue = 0.0;      // Amplitude at sample 0, of either sign.
};

// Returns the factor per sample of a mode with this T60; 1 for infinity.
double pole_radius(double t60_s, double rate_hz);

// Position and window of a frame.
struct ModalFrame {
  Window window = Window::hann;
  std::size_t size = 2048;  // Samples.
  std::size_t at = 0;       // Index of its first sample.
};

// Returns the amplitude of each partial in a frame: |residue| r^at |sum w[m] r^m| / sum w[m].
// Leaves out frequencies that are not between 0 and half the rate, exclusive. O(partials)
std::vector<Partial> partials_in_frame(std::span<const DecayingPartial> partials,
                                       const ModalFrame& frame, double rate_hz);

// Computes the shape of lines in ascending order of frequency; empty for silence.
std::optional<SpectralShape> spectral_shape(std::span<const Partial> partials, SpectrumKind kind);

}  // namespace ressort::analysis
