// app/commands: figures as files.
#pragma once

#include <string>

#include "app/plot/plot.h"

namespace ressort::commands {

// Draws a figure and writes it as SVG; prints what went wrong on stderr. Returns the exit code.
// [control]
int put_figure(const std::string& path, const plot::Figure& figure, bool force);

}  // namespace ressort::commands
