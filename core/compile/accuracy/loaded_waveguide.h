// core/compile: the lowest partial of a waveguide that is loaded with springs, masses and bodies. A
// stiff bridge shortens the string, a light one lengthens it.
//
// At a pole z every signal is X z^n, which turns the kernel's equations into algebra. A force of 1
// moves a mass by D = 1/(M (z - 2 + 1/z) + K + Z (1 - 1/z)) and a place by the admittance of its
// waveguide (core/kernels/waveguides/rails.h). A spring exerts C = K + Z (1 - 1/z) per unit of
// elongation, a passive spring C = (K (z + 1/z) + Z (z - 1/z))/2. The unknowns are the tension of
// each spring and the wave in each loop. z is a pole if the Schur complement of the tuned loop, all
// other unknowns eliminated, is 0.
#pragma once

#include <optional>
#include <span>

#include "core/compile/accuracy/pitches.h"
#include "core/kernels/program.h"
#include "core/progress.h"

namespace ressort::compile {

inline constexpr std::size_t most_loading_springs = 96;  // more would take too long to load

// Returns the factors on every stiffness at which the lowest waveguide that keys tune has the pitch
// of each key, at these values of the parameters. Returns nothing if the waveguide's part has more
// than most_loading_springs, or if every waveguide is fixed. O(keys springs^3) [any thread but
// audio]
std::optional<Pitches> loaded_waveguide_pitches(const Machine& machine,
                                                std::span<const double> parameters,
                                                const Progress& progress = {},
                                                const PitchWindow& window = {});

}  // namespace ressort::compile
