// tests: networks that nobody wrote, from a seed, as texts. Each is one that two builds of the same
// kernel agree on: nothing in it is chaotic, so that what differs is a kernel's own doing.
//
// * No spring is stiff enough to be unstable at any pitch and turn of the tests.
// * Wherever a link's force has an edge (a finger that comes and goes, the zones of a pluck) it is
//   continuous: without damping of its own. An edge that rounding passes a sample earlier or later
//   then moves nothing.
// * What repels (a pluck's middle) or feeds (the falling friction of a bow) is weaker than the
//   spring and the damper that its mass hangs on besides: small differences die out.
// * Where links are nonlinear everything is held, so that nothing drifts to where they are steep.
//   Nor does it where a force is heard: far from 0 that is a small difference of large numbers.
#pragma once

#include <cstdint>
#include <string>

namespace ressort::support {

struct RandomNetwork {
  std::string family;
  std::string text;
  bool is_linear = true;
  bool may_drift = false;  // nothing holds some of it
};

RandomNetwork random_network(std::uint64_t seed);

}  // namespace ressort::support
