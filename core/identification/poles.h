// core/identification: finds the poles of a freely ringing sound by ESPRIT in sub-bands.
//
// Each band is shifted to frequency 0, filtered and decimated, so that it contains few poles and
// its noise is flat. Consecutive windows of a sum of damped sinusoids span one signal subspace. A
// small matrix maps the subspace to the one that starts a sample later; its eigenvalues are the
// poles. Sources: Roy and Kailath 1989, "ESPRIT"; Laroche 1993 for sub-bands. [any thread but
// audio]
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "core/identification/damped.h"
#include "core/progress.h"

namespace ressort::identification {

struct PoleSearch {
  // Power of two. The filter discards the first 14 times as many samples.
  std::size_t decimation = 64;
  double highest_omega = 3.0;  // Radians per sample.
};

// Returns the number of samples that pass before the filter is full.
std::size_t frames_lost(const PoleSearch& search);

// Returns the shortest sound that this search accepts, in samples.
std::size_t shortest_for(const PoleSearch& search);

// Returns log z per sample, omega above 0, of the poles that stand above the noise of their band.
// The channels have equal length and share their poles. Some poles may be spurious; a fit decides.
// Noise alone yields none. O(samples * 64 * channels + bands * 96^3)
std::vector<Complex> find_poles(std::span<const std::vector<double>> channels,
                                const PoleSearch& search, const Progress& progress);

}  // namespace ressort::identification
