// core/analysis: the linear part of a network, as matrices and modes.
#pragma once

#include <optional>
#include <span>

#include "core/linear_algebra/matrix.h"
#include "core/model/network.h"
#include "core/progress.h"

namespace ressort::analysis {

// Springs, dampers and oscillators only, at places that stay.
bool is_linear(const Network& network);

// One mode, in the network's own numbers: per sample at 44 100 Hz.
struct Mode {
  double stiffness = 0.0;     // k/m
  double damping = 0.0;       // z/m
  double frequency_hz = 0.0;  // as the explicit scheme sounds it at 44 100 Hz
};

// At what frequency the explicit scheme sounds a mode of k/m and z/m per sample at rate_hz:
// cos(theta) = (2 - k - z) / (2 sqrt(1 - z)). [any thread]
double scheme_frequency_hz(double stiffness, double damping, double rate_hz);

// The slowest mode that is no rigid motion, with springs, dampers and oscillators only: plucks,
// bows and contacts are open, position inputs are held. Its damping is the modal share of Z.
// Nothing where no mass is sprung, and where it would take too long: where masses hang together at
// random (Cholesky::most_work), or nearly alone. Sparse shift and invert: milliseconds for 1000
// masses. [any thread but audio]
std::optional<Mode> lowest_mode(const Network& network, std::span<const double> parameters,
                                const Progress& progress = {});

// The network, reduced to the shapes that its lowest mode is made of, whatever the dampers make of
// it: that mode without dampers first, some more of the lowest, and how the others give way to its
// dampers. M is 1.
struct LowestShapes {
  Mode mode;
  Matrix stiffness;  // [shape, shape] what keys move
  Matrix damping;
  Matrix fixed;                 // the stiffness that keys leave as it is, which the first has not
  double share_of_modes = 0.0;  // of bodies in the lowest one's motion, 0..1
};

// The same modes, in the same cases and the same time; or of the mode that is so many from the
// lowest, which is 1. [any thread but audio]
std::optional<LowestShapes> lowest_shapes(const Network& network,
                                          std::span<const double> parameters,
                                          const Progress& progress = {}, int number = 1);

}  // namespace ressort::analysis
