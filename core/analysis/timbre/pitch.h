// core/analysis/timbre: the fundamental frequency of a sound. [any thread but audio]
#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "core/rooms.h"

namespace ressort::analysis {

// How many samples are enough for it, at a rate: eight periods of 50 Hz, a power of two.
std::size_t pitch_samples(double rate_hz);

// By the normalised autocorrelation of McLeod and Wyvill 2005: the shortest lag that is nearly as
// good as the best, of 50 Hz to a fifth of the rate; and then the first partial's own frequency, if
// one stands there, so that a stiff string's f0 is that of its lowest mode. Nothing where no lag is
// good. O(samples log samples)
std::optional<double> find_f0(std::span<const double> samples, double rate_hz);

}  // namespace ressort::analysis
