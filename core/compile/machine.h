// core/compile: the stage that writes a network as tables of numbers, a Program for each part.
#pragma once

#include <span>

#include "core/compile/cull.h"
#include "core/kernels/program.h"
#include "core/model/network.h"
#include "core/progress.h"

namespace ressort::compile {

inline constexpr std::size_t most_parts = 32;        // further parts are stepped as one
inline constexpr std::size_t least_part_masses = 3;  // smaller parts are stepped as one

// Returns the ratio of 44,100 Hz to the sample rate, or 1 if numbers are not rescaled. Stiffness is
// multiplied by its square, damping by the ratio.
inline double rate_ratio_of(double rate_hz, bool rescale) {
  return rescale ? Network::reference_rate_hz / rate_hz : 1.0;
}

// Returns the network without culled elements, divided into its connected components, the largest
// first, each in the direct form. For networks without macros. `schemes`: [link]; empty: the
// published scheme for all. `start`: [parameter] initial values of the voices. O(n log n). [any
// thread but audio]
Machine tabulate(const Network& network, const Culled& culled, std::span<const Scheme> schemes,
                 std::span<const double> start, double rate_hz, bool rescale,
                 const Progress& progress = {});

// Returns the tables of a network with its macros, culled, with the published scheme for all links.
Machine make_machine(const Network& network, double rate_hz, bool rescale);

// Returns the tables of a network with its macros as one part, without culling.
Program make_program(const Network& network, double rate_hz, bool rescale,
                     std::span<const Scheme> schemes = {});

}  // namespace ressort::compile
