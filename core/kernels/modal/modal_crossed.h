// core/kernels: the modes of a body whose damping does not share the eigenvectors of its stiffness.
//
// Each is a complex number y of its own, y+ = p y + u f, and a mass is where the real part of the
// sum of all u y puts it. As M, K and Z are symmetric one u does for what pushes a mass and for
// where it is: of the pencil P(z) = (z-1)^2 M + (z-1) Z + z K, or s^2 M + s Z + K with p = e^s,
//   P(z) X = 0,  u = sqrt(p / X^T P' X) X
// (Tisseur and Meerbergen, SIAM Rev. 43, 2001). A pair of conjugates is one mode, a real pole is
// one as well.
#pragma once

#include <optional>
#include <vector>

#include "core/kernels/modal/modal_body.h"

namespace ressort::kernels {

inline constexpr std::uint32_t most_crossed_masses = 256;  // beyond, finding them takes too long

// Rows are [real part, imaginary part][mode].
struct CrossedModes {
  std::size_t count = 0;
  Vector pole;                        // p - 1
  std::vector<Vector> shape;          // [mass] u
  std::vector<Vector> push;           // [mass] what a force of 1 does that is held for a sample
  std::vector<Vector> speed;          // [mass] its change in the last sample
  std::vector<Vector> from_position;  // [mass] what it is worth, a sample after it is placed
  std::vector<Vector> from_velocity;  // [mass]
  Vector start;                       // the modes, a sample after the start
  Vector rest;                        // [mass] where it rests
};

// The published scheme's, or true to the continuous network. With the parameters where they are:
// the shapes are of no use for others. Nothing where parameters may turn K, Z or M; where the
// condition of the eigenvectors is above 1e8 (critical damping, what drifts), a pole is faster than
// Nyquist's frequency or gone in a sample, nothing says where it rests; or where passive links are
// to hold on to exact modes that may gain energy at their ends: unless the scheme whose modes these
// are has no negative damping, as mostly where something damps all masses. O(masses^3): 0.15 s for
// 120, 1.2 s for 250.
std::optional<CrossedModes> crossed_modes(const Program& program, const LinearBody& body,
                                          bool is_exact, bool is_held_passively);

}  // namespace ressort::kernels
