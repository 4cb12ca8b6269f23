// core/engine: what the voices of one kernel add to the channels, [frame][output][lane].
#pragma once

#include <cstddef>

#include "core/engine/isa.h"

namespace ressort {

template <class T>
struct Heard {
  const T* outputs = nullptr;
  std::size_t frames = 0;
  std::size_t count = 0;  // outputs
  std::size_t width = 1;  // lanes
};

template <class T>
struct Mixer {
  // The largest |y| of each lane; infinity where one is not below `bound`, or is no number.
  void (*find_peaks)(const Heard<T>& heard, double bound, T* peak);
  // sum[frame][output] = the sum of gain[lane] * y; what has the gain 0 may be anything.
  void (*add_voices)(const Heard<T>& heard, const double* gain, double* sum);
};

template <Isa isa, class T>
Mixer<T> make_mixer();

}  // namespace ressort
