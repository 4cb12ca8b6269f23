// app/commands: charts are drawn by a program of their own, ressort-chart: it is a third of all the
// code, and nobody who plays needs it.
#pragma once

#include <string>
#include <vector>

#include "app/rooms.h"

namespace ressort::commands {

struct ChartOptions {
  std::vector<std::string> scenes;  // none: the reference scenes
  std::string folder;               // is made if it is not there
  double patience_s = 5.0;          // for the timing of one scene
};

// Becomes ressort-chart, which lies beside this program. Where this one was built but that one was
// not yet, builds it first and shows how far it is. An exit code comes back where that fails.
int start_chart(const ChartOptions& options);

// The options as start_chart() gave them to ressort-chart.
ChartOptions chart_options(const std::vector<std::string>& arguments);

}  // namespace ressort::commands
