// app/commands: how long the ways of the chart take, in turns.
#pragma once

#include <functional>
#include <vector>

#include "app/commands/chart/ways.h"

namespace ressort::commands {

struct Timing {
  std::vector<double> ns;        // [way] per output sample
  std::vector<double> upper_ns;  // [way] the upper quartile of the rounds
  double seconds = 0.0;          // of sound that it is the mean of
  int rounds = 0;
};

// Nanoseconds of this thread's own time per output sample, the mean over the beginning of the
// scene's sound: of each stretch of it the fastest of several rounds, in which all ways play in
// turn. At least three rounds, more while `patience_s` lasts; as much of the sound as allows that.
// Stops early, with what it has, where `stops` says so; then `rounds` may be 0.
Timing time_ways(std::vector<MadeWay>& ways, double patience_s, const std::function<bool()>& stops);

// This thread stays on the core that it is on.
void stay_on_one_core();

}  // namespace ressort::commands
