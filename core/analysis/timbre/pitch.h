// core/analysis/timbre: detects the fundamental frequency of a sound. [any thread but audio]
#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "core/rooms.h"

namespace ressort::analysis {

// Returns the number of samples it needs at a rate: eight periods of 50 Hz, a power of two.
std::size_t pitch_samples(double rate_hz);

// Normalised autocorrelation (McLeod and Wyvill 2005): the shortest lag whose correlation is nearly
// the best, from 50 Hz to a fifth of the rate. If a partial lies near that frequency, its own
// frequency is returned, so that the f0 of a stiff string is that of its lowest mode. Empty if no
// lag correlates well enough. O(samples log samples)
std::optional<double> find_f0(std::span<const double> samples, double rate_hz);

}  // namespace ressort::analysis
