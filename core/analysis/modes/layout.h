// core/analysis/modes: positions of the masses of a network in a picture.
#pragma once

#include <cstdint>
#include <vector>

#include "core/model/network.h"

namespace ressort::analysis {

struct LayoutPoint {
  double x = 0.0;
  double y = 0.0;
  std::uint32_t mass = 0;  // Index in the network with macros expanded.
};

// A layout in the plane, or in consecutive rows.
struct MassLayout {
  bool is_plane = false;
  std::vector<std::vector<LayoutPoint>> rows;
  std::vector<double> tops;  // [macro] y of its first row. A waveguide has no masses but has a row.
};

// Returns the layout of a network with macros. The model's own drawing comes first, and meshes are
// rectangles. Without either, the two lowest eigenvectors of the graph Laplacian spread the masses;
// a chain becomes a row, and anything else keeps the order of its lines. [any thread but audio]
MassLayout layout_of(const Network& network);

}  // namespace ressort::analysis
