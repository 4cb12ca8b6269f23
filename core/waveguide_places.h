// core: where along a waveguide's loop its filters and its places are, in whatever unit of time.
// Seen by the kernels and by what is written in other languages, which never see each other.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

namespace ressort {

// Where a waveguide's filters are, as shares of what goes round from the right end, where waves
// turn to the left; and how much further on the next place is that something holds. What lies
// between held places is rounded from there, so that a string that gets longer does so without
// leaps.
struct FiltersAt {
  double share = 0.0;
  double to_held = 0.0;
};

// Which share of the loop a wave has gone through since the filters where it passes the
// coordinate u, 0 < u < 1, to the left or to the right: above 0, at most 1.
inline double share_from_filters(const FiltersAt& filters, double u, bool runs_right) {
  const double from_right_end = 0.5 * (1.0 - u);
  const double at = (runs_right ? 1.0 - from_right_end : from_right_end) - filters.share;
  return at > 0.0 ? at : at + 1.0;
}

// The same to tell the order in which waves pass places: two stay in theirs at every pitch.
inline double order_from_filters(const FiltersAt& filters, double u, bool runs_right) {
  constexpr double nearly = 1e-9;
  return share_from_filters(filters, u > nearly ? std::min(u, 1.0 - nearly) : nearly, runs_right);
}

// In the middle of the widest way between places that springs hold, `held` being their
// coordinates: what lies between two of those is a whole number of samples.
inline FiltersAt filters_between(const std::vector<double>& held) {
  std::vector<double> ways;  // from the right end
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
