// app/commands: a figure of the modes found in a recording. Pure.
#pragma once

#include <string>

#include "app/plot/plot.h"
#include "core/identification/identify.h"

namespace ressort::commands {

// Three panels over frequency: the spectrum of the recording with the peak of each mode, the T60 of
// each mode with its standard deviation, and the spectrum of the residual.
plot::Figure recording_figure(const Identification& found, const std::string& title);

}  // namespace ressort::commands
