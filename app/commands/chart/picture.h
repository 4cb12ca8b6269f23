// app/commands: the figures of the chart: error over time per sample. Pure.
#pragma once

#include <string>
#include <vector>

#include "app/commands/chart/table.h"
#include "app/plot/plot.h"

namespace ressort::commands {

// One scene against both references.
plot::Figure sheet_figure(const ChartSheet& sheet, const std::string& made_by);

// All scenes against the continuous network.
plot::Figure overview_figure(const std::vector<ChartSheet>& sheets, const std::string& made_by);

}  // namespace ressort::commands
