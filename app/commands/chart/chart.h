// app/commands: the chart of speed against accuracy. It times every method of computing a scene and
// measures its error against reference solutions.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "app/commands/chart/table.h"
#include "core/result.h"

namespace ressort::commands {

struct ChartOptions {
  std::vector<std::string> scenes;  // empty: the reference scenes
  std::string folder;               // created if it does not exist
  double patience_s = 5.0;          // longest time for timing one scene
};

// Writes chart.csv and, with gnuplot, overview.svg and SCENE.svg into the folder. Returns the exit
// code. [main]
int chart(const ChartOptions& options);

// Judges all methods that can play a scene, and times them if `patience_s` is above 0. `progress`
// gets the current step and returns false to stop; the sheet then has no rows.
Result<ChartSheet> make_sheet(const ChartScene& scene, Isa isa, double patience_s,
                              const std::function<bool(const std::string&)>& progress);

}  // namespace ressort::commands
