// bench: draws the figures of the measurements.
#pragma once

#include <string>
#include <vector>

#include "app/plot/plot.h"
#include "tests/bench/report.h"

namespace ressort::bench {

// Draws the cost per mass against the number of masses, for chains and for meshes. The figure has
// no panels if no such scene was measured.
plot::Figure cost_figure(const std::string& machine, const std::vector<Row>& rows);

// Draws the speed of each scene relative to FAUST's best variant, for the kernel that the plan
// chose and for the whole engine, in double and in float. Bars join the quartiles of the rounds.
// The figure has no panels if FAUST played nothing.
plot::Figure faust_figure(const std::string& machine, const std::vector<Row>& rows);

}  // namespace ressort::bench
