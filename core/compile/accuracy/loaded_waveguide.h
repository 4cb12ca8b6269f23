// core/compile: where the lowest partial of a waveguide is once springs, masses and bodies hold on
// to it: a stiff bridge makes the string shorter, a light one longer.
//
// At a pole z every motion is X z^n, and the kernel's own equations become algebra: a mass moves by
// D = 1/(M (z - 2 + 1/z) + K + Z (1 - 1/z)) for a force of 1, a place by what the waves around it
// let it (core/kernels/waveguides/rails.h), a spring pulls by C = K + Z (1 - 1/z) a unit of its
// length, or by C = (K (z + 1/z) + Z (z - 1/z))/2 where it is passive. One row for each spring's
// tension and one for the wave in each loop; it can swing on its own where, once all others are
// eliminated, nothing is left of the tuned loop's row.
#pragma once

#include <optional>
#include <span>

#include "core/compile/accuracy/pitches.h"
#include "core/kernels/program.h"
#include "core/progress.h"

namespace ressort::compile {

inline constexpr std::size_t most_loading_springs = 96;  // that a load has the time for

// By which factor on every stiffness the lowest waveguide that keys move has the pitch of a key;
// `parameters` as they are at the start. Nothing where more springs than that are in its part, or
// no waveguide moves. O(keys springs^3) [any thread but audio]
std::optional<Pitches> loaded_waveguide_pitches(const Machine& machine,
                                                std::span<const double> parameters,
                                                const Progress& progress = {});

}  // namespace ressort::compile
