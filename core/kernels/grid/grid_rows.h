// core/kernels: the rows of a regular network, in whatever order it was written.
#pragma once

#include <cstdint>
#include <vector>

#include "core/kernels/program.h"
#include "core/progress.h"

namespace ressort::kernels {

inline constexpr std::uint32_t nowhere = 0xffffffffu;
inline constexpr std::uint32_t least_regular_links = 8;  // of one run

// What may lie in a grid: the masses of one run, and grounds that are between a few of them, by the
// links of those runs that have many.
struct GridGraph {
  std::vector<std::uint32_t> start;       // [node] of its neighbours; one more at the end
  std::vector<std::uint32_t> neighbours;  // nodes
};
GridGraph grid_graph(const Program& program, std::uint32_t mass_run);

// Nodes whose position is given for every sample.
std::vector<bool> driven_nodes(const Program& program);

// Each a path of nodes that are linked one to the next; nodes without a link are in none.
using GridRows = std::vector<std::vector<std::uint32_t>>;

// As the nodes are numbered, without grounds. O(n)
GridRows rows_as_written(const Program& program, const GridGraph& graph, const Progress& progress);
// One along a side, then what is next to it, and so on. O(n log n)
GridRows rows_by_walk(const GridGraph& graph, const Progress& progress);

}  // namespace ressort::kernels
