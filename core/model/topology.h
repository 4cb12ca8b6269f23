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

// Nodes of a macro, [first, end) by its own numbers.
struct NodeRange {
  std::uint32_t first = 0;
  std::uint32_t end = 0;
};

// The same with these nodes of macros alone, and the links between them: [macro] ranges, ascending
// and apart from each other. A tap knows those around its place, if all of them are in one range.
// Of a network without bodies, waveguides and places that move.
Network expand_excerpt(const Network& network, std::span<const std::vector<NodeRange>> ranges);

}  // namespace ressort::model
