// app/realtime: peak values of the meters, kept separately for each reader.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "app/realtime/process.h"

namespace ressort::realtime {

// A reader of the meters. Each one sees the peaks since its own last reading; all OSC clients are
// one reader, and so are all panels.
enum class MeterReader : std::uint8_t { console, osc, panel };

class Peaks {
 public:
  // Adds the meters since the last call.
  void add(const Meters& meters) {
    for (Seen& seen : seen_) {
      seen.cpu = std::max(seen.cpu, meters.cpu_peak);
      seen.output = std::max(seen.output, meters.peak);
      seen.limited = std::min(seen.limited, meters.limited);
    }
  }
  // Replaces the peaks in `meters` by those since this reader's last call.
  void take(MeterReader asker, Meters& meters) {
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
