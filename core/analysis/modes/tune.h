// core/analysis/modes: tunes modes to target frequencies and decays by scaling springs and dampers.
#pragma once

#include <optional>
#include <span>
#include <string>

#include "core/analysis/modes/modes.h"
#include "core/model/network.h"
#include "core/result.h"

namespace ressort::analysis {

struct TuneTarget {
  std::size_t mode = 0;  // 0 is the lowest mode.
  double frequency_hz = 0.0;
  std::optional<double> t60_s;  // Without it the dampers stay unchanged.
  std::string part;             // Name of a mass, link or macro; empty: everything.
};

struct Tuned {
  Network network;
  double stiffness = 1.0;  // Factors that were found.
  double damping = 1.0;
};

// Returns the network with one factor on every stiffness of a part (everything connected to the
// name) and one on its dampers, such that the mode's damped pole has this frequency and decay. The
// mode is followed by its shape. Fails if the part cannot move the mode that far. Newton's method
// on the derivatives of the pole; each step solves for the modes again. [any thread but audio]
Result<Tuned> tune_mode(const Network& network, std::span<const double> parameters,
                        const TuneTarget& target, const ModeOptions& options);

// Returns the network with other springs, such that its lowest modes have these frequencies in Hz,
// ascending. The springs of each line get a factor of their own; of all solutions the factors
// nearest to 1 are taken. If a model has fewer lines than frequencies, its macros are expanded
// first, unless a link is attached to one by a place. Gauss-Newton: the derivative of a squared
// frequency by a spring's stiffness is the squared elongation of that spring in the mode. Dampers
// stay unchanged. Fails without convergence. [any thread but audio]
Result<Network> tune_modes(const Network& network, std::span<const double> parameters,
                           std::span<const double> frequencies_hz, const ModeOptions& options);

}  // namespace ressort::analysis
