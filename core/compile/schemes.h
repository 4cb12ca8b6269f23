// core/compile: which links are computed by a scheme that cannot gain energy, and why.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/compile/machine.h"
#include "core/model/network.h"
#include "core/model/preset/budget.h"
#include "core/progress.h"
#include "core/result.h"

namespace ressort::compile {

struct Schemes {
  std::vector<LinkScheme> links;   // [link] of a network without macros
  std::vector<std::string> notes;  // a sentence for every law that is made passive
  std::optional<Error> hazard;     // what may gain energy, at the model's line; nothing: nothing
};

// The linear scheme conserves its energy exactly, and whatever force is added does exactly the work
// F (x[n+1] - x[n-1])/2 (core/engine/energy.h); so a scene is passive if every other link's force
// does no more work than its potential gives back. A discrete gradient or a centred friction does
// so at any stiffness, however many of them share a mass. Of the published laws no theorem says
// it: a soft contact may gain at each touch, a spring that stiffens may be swung up by its own
// change of stiffness, a bow or a pluck may grip a sample too late, and what each of them does
// alone says nothing about several on one mass. So every link that is not linear is made passive,
// unless the budget says never; or it exerts nothing as all its strengths are 0 for good. Whatever
// holds a place on a waveguide is made passive in any case, springs too: no explicit form of it is
// stable there.
// For a network without macros. O(links). [any thread but audio]
Schemes choose_schemes(const Network& network, const Budget& budget, const Progress& progress = {});

// The network without the links that their scheme keeps stable however strong they are: what
// remains is what a proof of stability has to be about. Springs keep their K and Z, and so does
// what pushes instead of pulling. With macros or without, as it is given. O(n).
// [any thread but audio]
Network without_passive(const Network& network, std::span<const LinkScheme> schemes);

}  // namespace ressort::compile
