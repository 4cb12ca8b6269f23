// tests: random networks from a seed, as texts. None of them is chaotic, so two builds of a kernel
// agree, and any difference is due to the kernel.
//
// * No spring is stiff enough to be unstable at any pitch and parameter value of the tests.
// * A link whose force has an edge (a finger that touches and leaves, the zones of a pluck) has no
//  damping of its own, so its force is continuous at the edge. Passing the edge a sample earlier
//  or later by rounding then has no effect.
// * Repelling forces (the middle of a pluck) and energy sources (the falling friction of a bow) are
//  weaker than the spring and damper of their mass, so that small differences decay.
// * In a network with nonlinear links every mass is held, so that nothing drifts to where the links
//  are steep. The same applies to force outputs, which are small differences of numbers that grow
//  with the distance from 0.
#pragma once

#include <cstdint>
#include <string>

namespace ressort::support {

struct RandomNetwork {
  std::string family;
  std::string text;
  bool is_linear = true;
  bool may_drift = false;  // Part of it is not held.
};

RandomNetwork random_network(std::uint64_t seed);

}  // namespace ressort::support
