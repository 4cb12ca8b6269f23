// core/identification: converts identified modes into modes of a playable body. [any thread but
// audio]
//
// One mode of a body with mass M, shape p at the struck place and q at the place of the output
// responds to a unit force of one sample with p q / M r^(n-1) sin(n theta) / sin(theta), where r
// and theta follow from its T60 and its frequency at 44,100 Hz. That equals a free oscillation of
// amplitude p q / (M r sin theta) from time 0. Hence p q = M A r sin(theta), with a negative sign
// if the recording starts in antiphase to a sine. A single recording cannot separate p from q: the
// mode that the blow moves most gets p = 1, and every other p is the square root of its relative
// motion. M is the effective mass at the struck place.
#pragma once

#include <vector>

#include "core/identification/identify.h"

namespace ressort::identification {

struct BodyShape {
  double hit = 0.0;           // Displacement at the struck place.
  std::vector<double> heard;  // [channel]
};

// Returns the shapes in the order of the identified modes.
std::vector<BodyShape> body_shapes(const Identification& found, double mass);

}  // namespace ressort::identification
