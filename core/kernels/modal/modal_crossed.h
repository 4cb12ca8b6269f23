// core/kernels: complex modes, for a network with non-proportional damping.
//
// A mode is a complex number y with y[n+1] = p y[n] + u f[n], and the position of a mass is the
// real part of the sum of u y over the modes. M, K and Z are symmetric, so the same u distributes
// forces and reads positions. It is an eigenvector of the quadratic eigenvalue problem of the
// pencil P(z) = (z-1)^2 M + (z-1) Z + z K, or s^2 M + s Z + K with p = e^s for exact modes:
//   P(z) X = 0,  u = sqrt(p / X^T P' X) X
// (Tisseur and Meerbergen, SIAM Rev. 43, 2001). A pair of complex conjugates is one mode, and a
// real pole is one mode.
#pragma once

#include <optional>
#include <vector>

#include "core/kernels/modal/modal_body.h"

namespace ressort::kernels {

inline constexpr std::uint32_t most_crossed_masses = 256;  // more take too long to compute

// Rows are [real part, imaginary part][mode].
struct CrossedModes {
  std::size_t count = 0;
  Vector pole;                // p - 1
  std::vector<Vector> shape;  // [mass] u
  std::vector<Vector> push;   // [mass] response to a unit force that is held for a sample
  std::vector<Vector> speed;  // [mass] velocity
  // [mass] response to an initial displacement or velocity, one sample later
  std::vector<Vector> from_position;
  std::vector<Vector> from_velocity;
  Vector start;  // state one sample after the start
  Vector rest;   // [mass] equilibrium
};

// Computes the complex modes of the published scheme, or, if `is_exact`, of the continuous network,
// for the initial parameters. Empty if
//   - parameters may change K, Z or M, because the shapes depend on them;
//   - the condition of the eigenvectors is above 1e8 (critical damping, drifting masses);
//   - a pole is above the Nyquist frequency, or decays within a sample;
//   - there is no equilibrium;
//   - passive links act on exact modes that may gain energy at their ends. This is excluded if the
//     scheme with these modes has no negative damping, which is usual if all masses are damped.
// O(masses^3): 0.15 s for 120 masses, 1.2 s for 250.
std::optional<CrossedModes> crossed_modes(const Program& program, const LinearBody& body,
                                          bool is_exact, bool is_held_passively);

}  // namespace ressort::kernels
