// core/identification: where the poles of a sound are that rings freely: ESPRIT in sub-bands.
//
// Each band is shifted to 0, filtered and taken at a lower rate, so that few poles are in it and
// the noise within it is flat. What follows one another by a sample in a sum of damped sinusoids
// spans one subspace; how that subspace turns is a small matrix, and its eigenvalues are the poles.
// Roy and Kailath 1989, "ESPRIT"; Laroche 1993, in sub-bands. [any thread but audio]
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "core/identification/damped.h"
#include "core/progress.h"

namespace ressort::identification {

struct PoleSearch {
  std::size_t decimation = 64;  // a power of two. The filter costs 14 times so many first samples
  double highest_omega = 3.0;   // per sample
};

// How many samples pass before its filter is full.
std::size_t frames_lost(const PoleSearch& search);

// The shortest sound that such a search can do anything with, in samples.
std::size_t shortest_for(const PoleSearch& search);

// log z of what rises out of the noise of its band, per sample, omega above 0; channels of one
// length share their poles. Some may be spurious: a fit tells. None in noise alone.
// O(samples * 28 * channels + bands * 128^3)
std::vector<Complex> find_poles(std::span<const std::vector<double>> channels,
                                const PoleSearch& search, const Progress& progress);

}  // namespace ressort::identification
