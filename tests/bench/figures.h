// bench: the figures of what was measured.
#pragma once

#include <string>
#include <vector>

#include "app/plot/plot.h"
#include "tests/bench/report.h"

namespace ressort::bench {

// Cost per mass against the number of masses, of chains and of meshes. Without panels where no such
// scene was measured.
plot::Figure cost_figure(const std::string& machine, const std::vector<Row>& rows);

// Speed of each scene relative to the best of FAUST: the kernel of the plan's choice and
// the engine around it, in double and in float, with a bar from one quartile of the rounds to the
// other. Without panels where FAUST played nothing.
plot::Figure faust_figure(const std::string& machine, const std::vector<Row>& rows);

}  // namespace ressort::bench
