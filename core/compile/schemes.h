// core/compile: the stage that chooses for every link between the published law and a passive
// scheme.
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
  std::vector<Scheme> links;       // [link] of a network without macros
  std::vector<std::string> notes;  // a sentence for each law that is made passive
  std::optional<Error> hazard;     // links that may gain energy, with the model's line
};

// Makes every nonlinear link passive, unless the budget says `passive=never` or all its strengths
// are the constant 0. The linear scheme conserves a discrete energy, and a force F adds the work F
// (x[n+1] - x[n-1])/2 (core/engine/energy.h). A scene is therefore passive if no other link does
// more work than the decrease of its potential. This holds for a discrete gradient (Gonzalez 1996)
// and for friction at the mean velocity, at any stiffness and for any number of links on a mass.
// The published laws are not proved safe: a soft contact may gain energy at each touch, the
// changing stiffness of a hardening spring may drive it (parametric resonance), and a bow or a
// pluck may act one sample late. Links on a waveguide, including springs, are always passive,
// because no explicit scheme is stable there. For networks without macros. O(links). [any thread
// but audio]
Schemes choose_schemes(const Network& network, const Budget& budget, const Progress& progress = {});

// Returns the network without passive links, which is the subject of the stability proof. The
// network keeps the linear spring in a passive link, and passive links with a negative stiffness or
// damping. With or without macros. O(n). [any thread but audio]
Network without_passive(const Network& network, std::span<const Scheme> schemes);

}  // namespace ressort::compile
