// core/identification: identified modes as those of a body. [any thread but audio]
//
// One mode of a body, mass M, shape p where a force of 1 acts for one sample and q where it is
// heard, swings as p q / M r^(n-1) sin(n theta) / sin(theta), with r and theta of its T60 and
// frequency at 44100 Hz: as if from an amplitude p q / (M r sin theta) at the time 0. So p q = M A
// r sin(theta), negative where the recording begins with half a turn more than a sine. How p q is
// shared among p and q no single recording tells: here the mode that the blow moves most has p = 1,
// and any other p is the root of how much less it moves. M is how heavy the body is where it is
// struck.
#pragma once

#include <vector>

#include "core/identification/identify.h"

namespace ressort::identification {

struct BodyShape {
  double hit = 0.0;           // displacement where it is struck
  std::vector<double> heard;  // [channel]
};

// [mode] in their order.
std::vector<BodyShape> body_shapes(const Identification& found, double mass);

}  // namespace ressort::identification
