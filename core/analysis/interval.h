// core/analysis: interval arithmetic for formulas.
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
  bool operator==(const Range&) const = default;
};

// Lowest and highest values of the parameters: [parameter].
struct ParameterBox {
  std::vector<double> lowest;
  std::vector<double> highest;
};

// Returns a range that contains every value of the formula in the box. It is exact if each
// parameter occurs once, if the formula is monotone in all others, or if the box is a point, and
// slightly too wide otherwise. A formula that may
// be undefined gives the whole line. O(steps). [any thread but audio]
Range formula_range(std::span<const Step> formula, const ParameterBox& box);

// Returns whether the formula is affine in the parameter for all values of the others.
bool is_affine(std::span<const Step> formula, std::uint32_t parameter);

}  // namespace ressort::analysis
