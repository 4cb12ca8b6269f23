// app/commands: draws what every way of computing a scene costs beside how right it is. The exit
// code comes back.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "app/commands/chart/table.h"
#include "app/commands/start_chart.h"
#include "core/result.h"

namespace ressort::commands {

int chart(const ChartOptions& options);

// One scene's sheet, in all ways that can play it. `tells` hears what is going on and answers
// false to stop; then the sheet has no rows. Times only where `patience_s` is above 0.
Result<ChartSheet> make_sheet(const ChartScene& scene, Isa isa, double patience_s,
                              const std::function<bool(const std::string&)>& tells);

}  // namespace ressort::commands
