// core/compile: what of a network need not be computed, without a bit of any output changing.
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

// Joins every place on a macro that counts with all of the macro's nodes, and places on a waveguide
// with each other; `meet` hears of each node once.
template <class Counts, class Meet>
void join_places(const Network& network, Groups& groups, const Progress& progress, Counts&& counts,
                 Meet&& meet) {
  std::vector<bool> is_joined(network.masses.size(), false);  // [first node] of a macro
  std::vector<std::uint32_t> first(network.waveguides.size(), no_argument);  // of their places
  std::map<std::uint32_t, std::uint32_t> macros;                             // and of macros
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

// What can be left out. Grounds and position inputs pass nothing on, so that what hangs together
// is what moves and is linked. Of that, whatever no output can hear is left out. What is heard may
// be struck (core/engine/struck.h), whether or not anything else moves it.
struct Culled {
  std::vector<bool> is_dead;   // [mass] of any kind
  std::vector<bool> is_slack;  // [link] exerts nothing, whatever happens, or on dead masses only
  std::size_t unheard = 0;     // masses that move, or would
  std::size_t idle = 0;        // links whose stiffness and damping are 0
};

// For a network without macros. O(n). [any thread but audio]
Culled cull(const Network& network, const Progress& progress = {});

// "12 masses that no output hears, 1 link that exerts nothing"; empty if nothing is left out.
std::string describe(const Culled& culled);

}  // namespace ressort::compile
