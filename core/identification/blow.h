// core/identification: finds the loudest blow of a recording: its onset, and how much of the sound
// after it is worth analysing. [any thread but audio]
#pragma once

#include <cstddef>
#include <vector>

#include "core/result.h"
#include "core/rooms.h"

namespace ressort::identification {

// Channels of equal length; 1 is full scale.
struct Recording {
  double rate_hz = 44100.0;
  std::vector<std::vector<double>> channels;
};

inline constexpr double longest_ring_s = 10.0;   // Longest analysed sound after a blow.
inline constexpr double shortest_ring_s = 0.02;  // A shorter sound cannot be analysed.

struct Blow {
  std::size_t first = 0;  // Sample of the recording where the blow begins.
  bool is_first = true;   // No other blow precedes it.
  // Samples skipped after `first`, because they or their neighbours are clipped.
  std::size_t skipped = 0;
  // The sound that follows: the ringing, then some noise.
  std::vector<std::vector<double>> channels;
  double peak = 0.0;        // Largest magnitude after the channel's mean is removed.
  double offset = 0.0;      // Largest mean of a channel, relative to the peak.
  std::size_t clipped = 0;  // Total number of clipped samples (runs at the peak).
  double length_s = 0.0;    // Time from the blow to the end of the recording.
};

// Finds the blow. The error gives the reason if there is none: no samples, samples that are not
// finite, silence, or a sound that is too short.
Result<Blow> find_blow(const Recording& recording, bool skips_clipped = true);

}  // namespace ressort::identification
