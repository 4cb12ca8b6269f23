// core/identification: the one blow of a recording: where it begins, and how much of what follows
// is worth looking at. [any thread but audio]
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "core/result.h"
#include "core/rooms.h"

namespace ressort::identification {

// Channels of one length; 1 is full scale.
struct Recording {
  double rate_hz = 44100.0;
  std::vector<std::vector<double>> channels;
};

inline constexpr double longest_ring_s = 10.0;   // of what follows a blow
inline constexpr double shortest_ring_s = 0.02;  // with less there is nothing to go by

struct Blow {
  std::size_t first = 0;                      // sample of the recording
  std::size_t skipped = 0;                    // after it: they are clipped, or between such
  std::vector<std::vector<double>> channels;  // then, as long as it rings, and some noise
  double peak = 0.0;                          // largest magnitude, without the channel's mean
  double offset = 0.0;                        // largest mean of a channel, of the peak
  std::size_t clipped = 0;  // samples that stand at the peak beside others, in all
  double length_s = 0.0;    // from the blow to the recording's end
};

// The error says why there is none: no samples, no numbers, silence, too short.
Result<Blow> find_blow(const Recording& recording);

}  // namespace ressort::identification
