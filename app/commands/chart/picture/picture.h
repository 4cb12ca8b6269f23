// app/commands: the chart as gnuplot draws it.
#pragma once

#include <string>
#include <vector>

#include "app/commands/chart/table.h"

namespace ressort::commands {

// A script that draws, into the folder it is run in, SCENE.svg and SCENE.png for every sheet and
// overview.svg and overview.png for all; with its data.
std::string chart_script(const std::vector<ChartSheet>& sheets, const Provenance& provenance);

}  // namespace ressort::commands
