// core/analysis/modes: modes brought to where somebody wants them, by springs and dampers.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/analysis/modes/modes.h"
#include "core/model/network.h"
#include "core/result.h"

namespace ressort::analysis {

struct TuneTarget {
  std::size_t mode = 0;  // from the lowest, 0 first
  double frequency_hz = 0.0;
  std::optional<double> t60_s;  // without it dampers stay as they are
  std::string part;             // the name of a mass, a link or a macro; empty: all
};

struct Tuned {
  Network network;
  double stiffness = 1.0;  // the factors that did it
  double damping = 1.0;
};

// The network with one factor on every stiffness of a part (what hangs together with the name), and
// one on its dampers, with which the mode's damped pole has this frequency and decay. The mode is
// followed by its shape. Fails where the part does not move the mode that far. Newton on the pole's
// derivatives; each step finds the modes anew. [any thread but audio]
Result<Tuned> tune_mode(const Network& network, std::span<const double> parameters,
                        const TuneTarget& target, const ModeOptions& options);

// The network with other springs, so that its lowest modes have these frequencies in Hz, ascending:
// each line's springs get a factor of their own, those nearest to 1 that do it. Where a model has
// fewer lines than frequencies its macros are written out first, where no link
// holds them by a place. Gauss-Newton: a frequency grows
// with a spring's stiffness as the square of what the mode stretches it by. Dampers stay. Fails
// where that does not lead there. [any thread but audio]
Result<Network> tune_modes(const Network& network, std::span<const double> parameters,
                           std::span<const double> frequencies_hz, const ModeOptions& options);

}  // namespace ressort::analysis
