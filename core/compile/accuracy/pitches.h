// core/compile: by which factor on every stiffness the lowest mode that sounds has the frequency of
// a key: of its damped pole, in the form that plays it.
#pragma once

#include "core/analysis/linear.h"
#include "core/compile/accuracy/stepping.h"
#include "core/engine/engine.h"

namespace ressort {

// For every semitone of 440 Hz from a tenth of a hertz to half the rate: the pole of the mode that
// is lowest without dampers, found by Newton; dampers stay while stiffness changes. Of `shapes`,
// per sample at 44 100 Hz, as the form steps them at rate_hz. [any thread but audio]
Pitches make_pitches(const LowestShapes& shapes, const Stepping& stepping, double rate_hz,
                     double rate_ratio);

// How the part of a machine steps that the lowest mode is in; that of a body is exact everywhere.
Stepping stepping_of_lowest(const Machine& machine, const LowestShapes& shapes);

}  // namespace ressort
