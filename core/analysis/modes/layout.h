// core/analysis/modes: where the masses of a network are in a picture.
#pragma once

#include <cstdint>
#include <vector>

#include "core/model/network.h"

namespace ressort::analysis {

struct LayoutPoint {
  double x = 0.0;
  double y = 0.0;
  std::uint32_t mass = 0;  // of the network with its macros written out
};

// In the plane, or in rows that follow each other.
struct MassLayout {
  bool is_plane = false;
  std::vector<std::vector<LayoutPoint>> rows;
  std::vector<double>
      tops;  // [macro] y of its first row; a waveguide, which has no masses, is there
};

// As the model draws its masses, and its meshes as rectangles; where nothing is drawn, as the links
// pull them apart: by the two lowest vectors of the graph's Laplacian; a chain as a row, and what
// is none of these in the order of its lines. Of a network as it is written. [any thread but audio]
MassLayout layout_of(const Network& network);

}  // namespace ressort::analysis
