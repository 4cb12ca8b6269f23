// core: the values that a knob gives from one end to the other.
#pragma once

#include <algorithm>
#include <cmath>

namespace ressort {

struct KnobRange {
  double low = 0.0;  // value at the position 0
  double high = 1.0;
  bool exponential = false;  // equal steps of the knob are equal ratios

  double value_at(double position) const {
    return exponential ? low * std::pow(high / low, position) : low + position * (high - low);
  }
  // Returns the position at which the knob gives this value, limited to 0..1.
  double position_of(double value) const {
    if (low == high || (exponential && value * low <= 0.0)) {
      return 0.0;
    }
    const double position =
        exponential ? std::log(value / low) / std::log(high / low) : (value - low) / (high - low);
    return std::clamp(position, 0.0, 1.0);
  }
};

}  // namespace ressort
