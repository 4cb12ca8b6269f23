// core/model: expands macros to masses and links.
#pragma once

#include <vector>

#include "core/model/network.h"
#include "core/progress.h"

namespace ressort::model {

// Limit for one model, unless the caller has memory for more.
inline constexpr std::uint64_t max_macro_nodes = 4'000'000;

bool is_waveguide(MacroKind kind);
bool is_on_waveguide(const Network& network, std::uint32_t mass);  // a place, expanded or not
bool has_waveguide(const Network& network);
bool is_mesh(MacroKind kind);  // with length and width

// Returns true for bodies and modal strings.
bool consists_of_modes(MacroKind kind);
// Returns true for the place `bridge` of a modal string.
bool is_bridge(const Network& network, const Tap& tap);
std::uint64_t node_count(const Macro& macro);
std::uint64_t link_count(const Macro& macro);  // after expansion

// Returns the index of the first mass of each macro in the expanded network.
std::vector<std::uint32_t> macro_starts(const Network& network);

bool is_fixed(const Macro& macro, std::uint32_t node);  // numbered within the macro

// Returns the network with all macros replaced by masses and links without names, and sets the node
// ranges of the taps. O(nodes). [any thread but audio]
Network expand_macros(const Network& network, const Progress& progress = {});

}  // namespace ressort::model
