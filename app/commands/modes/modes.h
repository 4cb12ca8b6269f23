// app/commands: which modes a model or a preset has, and the model with other ones. The exit code
// comes back.
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
  std::string output;     // an .svg of their shapes, or the .mdl that is tuned; empty: none
  std::size_t count = 0;  // of the lowest; 0: all of a small model
  double rate_hz = 44100.0;
  bool is_continuous = false;  // instead of the published scheme's
  bool as_json = false;
  bool force = false;                  // write over a file that is there
  std::vector<double> frequencies_hz;  // that the lowest modes shall have
  std::vector<DecayPoint> decay;       // that every mode shall follow
  std::optional<ThirdArgument> third;  // whatever preset and model say
};

// Tells the modes on stdout, those of the tuned model where it is to be tuned. [main]
int modes_command(const ModesOptions& options);

}  // namespace ressort::commands
