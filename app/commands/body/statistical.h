// app/commands: writes a body whose modes are drawn from statistics.
#pragma once

#include <string>
#include <vector>

#include "app/rooms.h"
#include "core/analysis/modes/statistical.h"
#include "core/result.h"

namespace ressort::commands {

struct StatisticalBodyOptions {
  BodyStatistics statistics;
  std::string output;    // empty: stdout
  bool force = false;    // overwrites existing files
  int most_modes = 400;  // limit of the mean number of drawn modes
};

// Returns the model: the command that writes it, the body, a force input at the bridge and outputs
// at left and right.
std::string statistical_model(const StatisticalBodyOptions& options);

// Returns the exit code. [main]
int statistical_body(const StatisticalBodyOptions& options);

// Parses "HZ:VALUE,HZ:VALUE,..." with values in a range, or a single VALUE for all frequencies.
Result<std::vector<CurvePoint>> parse_curve(const std::string& text, double least, double most);

// Parses "HZ,Q", "HZ,Q,BRIDGE", "HZ,Q,BRIDGE,LEFT" or "HZ,Q,BRIDGE,LEFT,RIGHT".
Result<GivenMode> parse_mode(const std::string& text);

}  // namespace ressort::commands
