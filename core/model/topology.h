// core/model: the shapes that macros stand for.
#pragma once

#include "core/model/network.h"
#include "core/progress.h"

namespace ressort::model {

inline constexpr std::uint64_t max_macro_nodes = 4'000'000;  // of one model

bool is_waveguide(MacroKind kind);
bool is_on_waveguide(const Network& network, std::uint32_t mass);  // a place, written out or not
bool has_waveguide(const Network& network);
bool is_mesh(MacroKind kind);  // has a length and a width

std::uint64_t node_count(const Macro& macro);

// [macro] where its masses begin in the network with every macro written out.
std::vector<std::uint32_t> macro_starts(const Network& network);

// The same network with every macro written out as masses and links, which have no names, and its
// taps told where its nodes are. O(nodes). [any thread but audio]
Network expand_macros(const Network& network, const Progress& progress = {});

}  // namespace ressort::model
