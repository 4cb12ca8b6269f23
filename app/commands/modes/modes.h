// app/commands: computes the modes of a model or a preset, and tunes them.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/rooms.h"
#include "core/analysis/modes/scaling.h"
#include "core/model/network.h"

namespace ressort::commands {

struct ModesOptions {
  std::string name;
  std::string output;     // .svg of the mode shapes, or the tuned .mdl; empty: none
  std::size_t count = 0;  // number, from the lowest; 0: all of a small model
  double rate_hz = 44100.0;
  bool is_continuous = false;  // instead of the published scheme
  bool as_json = false;
  bool force = false;                  // overwrites an existing file
  std::vector<double> frequencies_hz;  // targets of the lowest modes
  std::vector<DecayPoint> decay;       // targets of all modes
  std::optional<ThirdArgument> third;  // empty: as the preset or the model says
};

// Prints the modes, after tuning. Returns the exit code. [main]
int modes_command(const ModesOptions& options);

}  // namespace ressort::commands
