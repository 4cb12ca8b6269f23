// core/compile: the stage that leaves out elements which no output can hear. It changes no bit of
// any output.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "core/groups.h"
#include "core/model/network.h"
#include "core/progress.h"

namespace ressort::compile {

// Joins the groups of each place on a macro for which counts(place) with those of all nodes of the
// macro, and the groups of places on the same waveguide. Calls meet(node) once for each node.
template <class Counts, class Meet>
void join_places(const Network& network, Groups& groups, const Progress& progress, Counts&& counts,
                 Meet&& meet) {
  std::vector<bool> is_joined(network.masses.size(), false);  // [first node] of a macro
  std::vector<std::uint32_t> first(network.waveguides.size(),
                                   no_argument);  // [waveguide] its first place
  std::map<std::uint32_t, std::uint32_t> macros;  // macro -> its first place
  for (std::uint32_t i = 0; i < network.masses.size(); ++i) {
    if (network.masses[i].kind == MassKind::junction && counts(i)) {
      std::uint32_t& other = first[network.taps[network.masses[i].tap].macro];
      other = other == no_argument ? i : other;
      groups.join(i, other);
    }
    if (network.masses[i].kind != MassKind::point || !counts(i)) {
      continue;
    }
    const Tap& tap = network.taps[network.masses[i].tap];
    groups.join(i, tap.first);
    groups.join(i, macros.try_emplace(tap.macro, i).first->second);
    const std::uint32_t count = tap.length * tap.width;
    progress.spend(is_joined[tap.first] ? 1 : count);
    for (std::uint32_t k = 0; !is_joined[tap.first] && k < count; ++k) {
      meet(tap.first + k);
      groups.join(i, tap.first + k);
    }
    is_joined[tap.first] = true;
  }
}

// Elements to leave out: connected components without an output, and links without strength.
// Grounds and position inputs connect no components, because no motion passes through them.
// Components without an input stay, because their masses may be struck (core/engine/struck.h).
struct Culled {
  std::vector<bool> is_dead;   // [mass of any kind]
  std::vector<bool> is_slack;  // [link] has no strength, or acts on dead masses only
  std::size_t unheard = 0;     // number of dead masses that could move
  std::size_t idle = 0;        // number of links whose stiffness and damping are 0
};

// For networks without macros. O(n). [any thread but audio]
Culled cull(const Network& network, const Progress& progress = {});

// Returns "12 masses that no output hears, 1 link without strength"; empty if every element stays.
std::string describe(const Culled& culled);

}  // namespace ressort::compile
