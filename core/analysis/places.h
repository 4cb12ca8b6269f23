// core/analysis: resolves places on macros. For networks without macros.
#pragma once

#include <algorithm>
#include <span>

#include "core/model/network.h"

namespace ressort::analysis {

// Returns whether the mass is a place whose coordinates may change.
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

// The two neighbouring nodes, or places of a body, around a coordinate, and the weight between
// them.
struct Between {
  std::uint32_t below = 0;
  double beyond = 0.0;
};
inline Between between(double coordinate, std::uint32_t count) {
  const double p =
      (coordinate > 0.0 ? std::min(coordinate, 1.0) : 0.0) * static_cast<double>(count - 1);
  const auto below = static_cast<std::uint32_t>(p);
  return {below, p - below};
}

// Returns the displacements of a place of a body in its modes: one of Network::shapes per mode.
inline std::span<const double> shape_at(const Network& network, const Tap& tap,
                                        std::uint32_t place) {
  return std::span(network.shapes).subspan(tap.shape + std::size_t{place} * tap.length, tap.length);
}

// Calls `use(mass, share)` for the mass itself, or for the masses around a place with the kernels'
// interpolation weights. A place that is not live does not read parameters. The shares add up to 1,
// except on a body.
template <class Use>
void each_share(const Network& network, std::uint32_t mass, Use&& use,
                std::span<const double> parameters = {}) {
  if (network.masses[mass].kind != MassKind::point) {
    use(mass, 1.0);
    return;
  }
  const Tap& tap = network.taps[network.masses[mass].tap];
  const double along = argument_value(network, tap.u, parameters);
  if (tap.places > 0) {
    const Between u = between(along, tap.places);
    const auto near = shape_at(network, tap, u.below);
    const auto far = shape_at(network, tap, u.below + (u.beyond > 0.0 ? 1 : 0));
    for (std::uint32_t mode = 0; mode < tap.length; ++mode) {
      const double share = (1.0 - u.beyond) * near[mode] + u.beyond * far[mode];
      if (share != 0.0) {
        use(tap.first + mode, share);
      }
    }
    return;
  }
  const Between u = between(along, tap.length);
  const Between v = between(argument_value(network, tap.v, parameters), tap.width);
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

}  // namespace ressort::analysis
