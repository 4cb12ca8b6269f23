// core/analysis: what can be said of a network's stability before it sounds.
#pragma once

#include <span>

#include "core/model/network.h"

namespace ressort {

// Parameter values at both ends of where they may be turned to.
struct ParameterBox {
  std::vector<double> lowest;
  std::vector<double> highest;
};

// The factor on every stiffness up to which the explicit scheme is certainly stable, anywhere in
// the box: the edge bound max over links of (d_i/m_i + d_j/m_j) < 4, with d the sum of k + 2z at a
// mass; plucks, bows and contacts enter with their steepest slopes. `rate_ratio` is 44100 / rate.
// At most 0 where the dampers alone are too strong; 1e9 where there is nothing to bound.
// O(links). [any thread but audio]
double highest_stiffness_factor(const Network& network, const ParameterBox& box, double rate_ratio);

}  // namespace ressort
