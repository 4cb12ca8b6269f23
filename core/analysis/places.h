// core/analysis: what a place on a macro stands for. Of networks without macros.
#pragma once

#include <algorithm>

#include "core/model/network.h"

namespace ressort {

// Is it a place whose coordinates may change?
inline bool is_live_place(const Network& network, std::uint32_t mass) {
  if (network.masses[mass].kind != MassKind::point) {
    return false;
  }
  const Tap& tap = network.taps[network.masses[mass].tap];
  const auto is_live = [&](ArgumentId id) {
    return id != no_argument && !is_constant(network.arguments[id]);
  };
  return is_live(tap.u) || is_live(tap.v);
}

// Calls `use(mass, share)` for the mass itself, or for those around a place, by the kernels'
// weights. A place that is not live asks for no parameters.
template <class Use>
void each_share(const Network& network, std::uint32_t mass, Use&& use,
                std::span<const double> parameters = {}) {
  if (network.masses[mass].kind != MassKind::point) {
    use(mass, 1.0);
    return;
  }
  const Tap& tap = network.taps[network.masses[mass].tap];
  struct Side {
    std::uint32_t below = 0;
    double beyond = 0.0;
  };
  const auto side = [&](ArgumentId coordinate, std::uint32_t nodes) {
    const double value = argument_value(network, coordinate, parameters);
    const double p = (value > 0.0 ? std::min(value, 1.0) : 0.0) * static_cast<double>(nodes - 1);
    const auto below = static_cast<std::uint32_t>(p);
    return Side{below, p - below};
  };
  const Side u = side(tap.u, tap.length);
  const Side v = side(tap.v, tap.width);
  for (std::uint32_t i = 0; i < 2; ++i) {
    for (std::uint32_t j = 0; j < 2; ++j) {
      const double share =
          (i == 0 ? 1.0 - u.beyond : u.beyond) * (j == 0 ? 1.0 - v.beyond : v.beyond);
      if (share > 0.0) {
        use(tap.first + (u.below + i) * tap.width + v.below + j, share);
      }
    }
  }
}

}  // namespace ressort
