// core/model: the shapes that macros stand for.
#pragma once

#include <span>
#include <vector>

#include "core/model/network.h"
#include "core/progress.h"

namespace ressort::model {

// Of one model, unless who reads it has the memory for more.
inline constexpr std::uint64_t max_macro_nodes = 4'000'000;

bool is_waveguide(MacroKind kind);
bool is_on_waveguide(const Network& network, std::uint32_t mass);  // a place, written out or not
bool has_waveguide(const Network& network);
bool is_mesh(MacroKind kind);  // has a length and a width

std::uint64_t node_count(const Macro& macro);
std::uint64_t link_count(const Macro& macro);  // once it is written out

// [macro] where its masses begin in the network with every macro written out.
std::vector<std::uint32_t> macro_starts(const Network& network);

bool is_fixed(const Macro& macro, std::uint32_t node);  // by its own number

// The same network with every macro written out as masses and links, which have no names, and its
// taps told where its nodes are. O(nodes). [any thread but audio]
Network expand_macros(const Network& network, const Progress& progress = {});

}  // namespace ressort::model
