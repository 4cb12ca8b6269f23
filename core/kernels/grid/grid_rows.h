// core/kernels: finds the rows of a regular network in any order of numbering.
#pragma once

#include <cstdint>
#include <vector>

#include "core/kernels/program.h"
#include "core/progress.h"

namespace ressort::kernels {

inline constexpr std::uint32_t nowhere = 0xffffffffu;
inline constexpr std::uint32_t least_regular_links = 8;  // Per run.

// Candidates for a grid: the masses of one run, the grounds with few links, and the links of large
// runs.
struct GridGraph {
  std::vector<std::uint32_t> start;  // [node] Index of its first neighbour; one more at the end.
  std::vector<std::uint32_t> neighbours;  // Nodes.
};
GridGraph grid_graph(const Program& program, std::uint32_t mass_run);

// Returns the nodes whose position is an input.
std::vector<bool> driven_nodes(const Program& program);

// Each row is a path of linked nodes; nodes without a link are in none.
using GridRows = std::vector<std::vector<std::uint32_t>>;

// Returns the rows in numbered order, grounds excluded. O(n)
GridRows rows_as_written(const Program& program, const GridGraph& graph, const Progress& progress);
// Returns one row along a side, then its neighbours, and so on. O(n log n)
GridRows rows_by_walk(const GridGraph& graph, const Progress& progress);

}  // namespace ressort::kernels
