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

// An output of positions alone has no other phases. With a second place whose velocity is heard,
// x[n] - x[n-1] at 44,100 Hz, the sum A r^n cos(n theta + phi) takes the shares
// v = r cos(phi) / sin(theta) of the velocity and -sin(phi) - v (1 - cos(theta) / r) of the
// position, relative to p q.
struct BodyShape {
  double hit = 0.0;              // Displacement at the struck place.
  std::vector<double> heard;     // [channel]
  std::vector<double> position;  // [channel] The same beside a velocity.
  std::vector<double> velocity;  // [channel]
};

// Returns the shapes in the order of the identified modes.
std::vector<BodyShape> body_shapes(const std::vector<IdentifiedMode>& modes, double mass);

}  // namespace ressort::identification
