// core/analysis: the linear part of a network as matrices and modes.
#pragma once

#include <optional>
#include <span>

#include "core/linear_algebra/matrix.h"
#include "core/model/network.h"
#include "core/progress.h"

namespace ressort::analysis {

// Returns whether the network has only springs, dampers and oscillators, at places that do not
// move.
bool is_linear(const Network& network);

// One mode, in the network's own units: per sample at 44,100 Hz.
struct Mode {
  double stiffness = 0.0;     // k/m
  double damping = 0.0;       // z/m
  double frequency_hz = 0.0;  // Frequency at which the explicit scheme plays it at 44,100 Hz.
};

// Returns the frequency at which the explicit scheme plays a mode of k/m and z/m per sample at
// rate_hz: cos(theta) = (2 - k - z) / (2 sqrt(1 - z)). [any thread]
double scheme_frequency_hz(double stiffness, double damping, double rate_hz);

// The network reduced to a small basis from which its lowest damped mode can be computed: the
// lowest undamped mode first, a few more of the lowest, and the static response of the others to
// its dampers. M is the identity.
struct LowestShapes {
  Mode mode;
  Matrix stiffness;  // [shape, shape] The stiffness that keys scale.
  Matrix damping;
  // [shape, shape] The stiffness that keys leave unchanged, and that `stiffness` does not contain.
  Matrix fixed;
  double share_of_modes = 0.0;  // Share of bodies in the lowest mode's motion, 0 to 1.
};

// Returns the reduced network, with the lowest mode that is not a rigid motion. Only springs,
// dampers and oscillators count: plucks, bows and contacts are open, position inputs are held. The
// mode's damping is the modal share of Z. Empty if no mass has a spring, or if the links are so
// random or so dense that a factorisation would take too long (Cholesky::most_work). Sparse
// shift-and-invert: milliseconds for 1000 masses. [any thread but audio]
std::optional<LowestShapes> lowest_shapes(const Network& network,
                                          std::span<const double> parameters,
                                          const Progress& progress = {});

}  // namespace ressort::analysis
