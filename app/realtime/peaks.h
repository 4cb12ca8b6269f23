// app/realtime: the highest and lowest that meters have shown, apart for each who asks for them.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "app/realtime/process.h"

namespace ressort::realtime {

// Whoever asks sees what was since he asked last; OSC's clients, and the panel's, are one.
enum class Asker : std::uint8_t { console, osc, panel };

class Peaks {
 public:
  // What the audio thread has told since the last call.
  void add(const Meters& meters) {
    for (Seen& seen : seen_) {
      seen.cpu = std::max(seen.cpu, meters.cpu_peak);
      seen.output = std::max(seen.output, meters.peak);
      seen.limited = std::min(seen.limited, meters.limited);
    }
  }
  // In place of what `meters` says; then it starts anew for this one.
  void take(Asker asker, Meters& meters) {
    const Seen seen = std::exchange(seen_[static_cast<std::size_t>(asker)], {});
    meters.cpu_peak = seen.cpu;
    meters.peak = seen.output;
    meters.limited = seen.limited;
  }

 private:
  struct Seen {
    double cpu = 0.0;
    double output = 0.0;
    double limited = 1.0;
  };
  std::array<Seen, 3> seen_;
};

}  // namespace ressort::realtime
