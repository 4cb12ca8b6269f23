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

namespace base {
template <class T>
Mixer<T> mixer();
}
namespace v3 {
template <class T>
Mixer<T> mixer();
}
namespace v4 {
template <class T>
Mixer<T> mixer();
}

template <class T>
Mixer<T> mixer_for(Isa isa) {
#if RESSORT_X86_LEVELS
  if (isa == Isa::v4) {
    return v4::mixer<T>();
  }
  if (isa == Isa::v3) {
    return v3::mixer<T>();
  }
#endif
  static_cast<void>(isa);
  return base::mixer<T>();
}

}  // namespace ressort
