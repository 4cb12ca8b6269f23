// core/analysis: what a formula can amount to while its parameters are turned.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/formula.h"
#include "core/rooms.h"

namespace ressort::analysis {

struct Range {
  double lowest = 0.0;
  double highest = 0.0;
};

// Parameter values at both ends of where they may be turned to; [parameter].
struct ParameterBox {
  std::vector<double> lowest;
  std::vector<double> highest;
};

// A range that holds every value of the formula in the box: the exact one where each parameter
// occurs once, or where the box is a point; elsewhere a little wide. What may be no number is
// everything. O(steps). [any thread but audio]
Range formula_range(std::span<const Step> formula, const ParameterBox& box);

// Is it a straight line along the parameter, whatever the others are?
bool is_affine(std::span<const Step> formula, std::uint32_t parameter);

}  // namespace ressort::analysis
