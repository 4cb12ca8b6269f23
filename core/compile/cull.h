// core/compile: what of a network need not be computed, without a bit of any output changing.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "core/model/network.h"
#include "core/progress.h"

namespace ressort {

// What can be left out. Grounds and position inputs pass nothing on, so that what hangs together
// is what moves and is linked. Of that, whatever no output can hear is left out, and whatever
// nothing can move: what starts at 0 and at rest, and is tied to nothing but grounds at 0.
struct Culled {
  std::vector<bool> is_dead;   // [mass] of any kind
  std::vector<bool> is_slack;  // [link] exerts nothing, whatever happens, or on dead masses only
  std::size_t unheard = 0;     // masses that move, or would
  std::size_t unmoved = 0;
  std::size_t idle = 0;  // links whose stiffness and damping are 0
};

// For a network without macros. O(n). [any thread but audio]
Culled cull(const Network& network, const Progress& progress = {});

// "12 masses that no output hears, 3 that nothing moves"; empty if nothing is left out.
std::string describe(const Culled& culled);

}  // namespace ressort
