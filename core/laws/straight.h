// core/laws: laws that are made of straight pieces. Between two of its corners such a law is a
// spring with a damper and a constant force, so that a linear body stays linear.
#pragma once

#include "core/laws/law.h"

namespace ressort::laws {
inline namespace RESSORT_ISA {
inline namespace RESSORT_ROUNDING {

// f = stiffness d + damping v + offset for low < d < high.
template <class T>
struct StraightPiece {
  T low;
  T high;
  T stiffness;
  T damping;
  T offset;
};

// A law that tells the piece next to a distance, on which that lies unless it is a corner or
// outside of the law's zone.
template <class ForceLaw, class T>
concept Straight = requires(const ForceLaw& law, T d) {
  StraightPiece<T>{law.piece(d)};
};

}  // namespace RESSORT_ROUNDING
}  // namespace RESSORT_ISA
}  // namespace ressort::laws
