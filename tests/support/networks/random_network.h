// tests: random networks from a seed, as texts. None is chaotic, so that two builds of a kernel
// agree, and any difference is due to the kernel.
//
// * No spring is stiff enough to be unstable at any pitch and parameter value of the tests.
// * A link whose force has an edge (a finger that comes and goes, the zones of a pluck) is
// continuous
//  there: it has no damping of its own. An edge passed a sample earlier or later by rounding then
//  has no effect.
// * Repelling forces (the middle of a pluck) and energy sources (the falling friction of a bow) are
//  weaker than the spring and damper of their mass, so that small differences decay.
// * In a network with nonlinear links everything is held, so that nothing drifts to where they are
//  steep. The same holds for force outputs, which are small differences of large numbers far from
//  0.
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
