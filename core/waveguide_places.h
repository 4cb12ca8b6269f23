// core: the positions of filters and connection places in a waveguide's loop, as shares of one
// round trip. Shared by the kernels and the FAUST export, which do not see each other.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

namespace ressort {

// The position of a waveguide's filters, as a share of the round trip from the right end, where
// waves turn to the left; and the distance from there to the next place that a spring holds. Delays
// between held places are rounded from there, so that a string whose length changes does not jump.
struct FiltersAt {
  double share = 0.0;
  double to_held = 0.0;
  bool operator==(const FiltersAt&) const = default;
};

// Returns the share of the round trip between the filters and the point where a wave passes the
// coordinate u, 0 < u < 1, to the left or to the right. The result is in (0, 1].
inline double share_from_filters(const FiltersAt& filters, double u, bool runs_right) {
  const double from_right_end = 0.5 * (1.0 - u);
  const double at = (runs_right ? 1.0 - from_right_end : from_right_end) - filters.share;
  return at > 0.0 ? at : at + 1.0;
}

// Returns the same with u clamped inside the ends, as a sort key: the order of two places is the
// same at every pitch.
inline double order_from_filters(const FiltersAt& filters, double u, bool runs_right) {
  constexpr double nearly = 1e-9;
  return share_from_filters(filters, u > nearly ? std::min(u, 1.0 - nearly) : nearly, runs_right);
}

// Places the filters in the middle of the widest gap between the places that springs hold, whose
// coordinates are `held`. The delay between two held places is a whole number of samples.
inline FiltersAt filters_between(const std::vector<double>& held) {
  std::vector<double> ways;  // distances from the right end
  for (const double u : held) {
    ways.push_back(0.5 * (1.0 - std::clamp(u, 0.0, 1.0)));
    ways.push_back(1.0 - ways.back());
  }
  std::sort(ways.begin(), ways.end());
  FiltersAt filters;
  double widest = 0.0;
  for (std::size_t i = 0; i < ways.size(); ++i) {
    const double next = i + 1 < ways.size() ? ways[i + 1] : ways[0] + 1.0;
    if (next - ways[i] > widest + 1e-9) {
      widest = next - ways[i];
      filters = {.share = std::fmod(0.5 * (next + ways[i]), 1.0),
                 .to_held = 0.5 * (next - ways[i])};
    }
  }
  return filters;
}

}  // namespace ressort
