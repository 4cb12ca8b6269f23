#include "core/analysis/stability.h"

#include <algorithm>

namespace ressort {
namespace {

// 4 is the limit; a little below it modes near the Nyquist frequency still decay.
constexpr double limit = 4.0 * 0.98;

// What a link adds to k + 2z at its ends: the part that grows with the stiffness factor, and the
// part that does not.
struct Weight {
  double stiff = 0.0;
  double damped = 0.0;
};

Weight weight_of(const Network& network, const Link& link, std::span<const double> highest,
                 double r) {
  const auto value = [&](int i) {
    return std::max(0.0,
                    argument_value(network, link.arguments[static_cast<std::size_t>(i)], highest));
  };
  switch (link.kind) {
    case LinkKind::spring:
    case LinkKind::contact:
      return {value(0) * r * r, 2.0 * value(1) * r};
    // The steepest slope of a quadratic or cubic spring grows with the amplitude, which is not
    // known here; its linear part is what counts at rest.
    case LinkKind::quadratic_spring:
    case LinkKind::cubic_spring:
      return {value(0) * r * r, 2.0 * value(2) * r};
    case LinkKind::clipped_spring: {
      const double k = std::max(value(0), value(2));
      return {1.6 * k * r * r, 2.0 * value(3) * r};
    }
    case LinkKind::clipped_contact: {
      const double k = std::max(value(0), value(2));
      return {k * r * r, 2.0 * value(3) * r};
    }
    case LinkKind::pluck:
      return {0.1 * value(0) * r * r, 2.0 * value(2) * r};
    // A bow's friction grows with the square root of the factor; counting it with the factor
    // itself is on the safe side above 1.
    case LinkKind::bow:
      return {2.0 * value(0) * r * 2.0 / 3.0, 0.0};
    case LinkKind::smooth_bow:
      return {2.0 * value(0) * r * 1.0387, 0.0};
  }
  return {};
}

}  // namespace

double highest_stiffness_factor(const Network& network, const ParameterBox& box,
                                double rate_ratio) {
  std::vector<Weight> sums(network.masses.size());
  std::vector<double> inverse_mass(network.masses.size(), 0.0);
  for (std::size_t i = 0; i < network.masses.size(); ++i) {
    const Mass& mass = network.masses[i];
    if (mass.kind != MassKind::mass && mass.kind != MassKind::oscillator) {
      continue;
    }
    inverse_mass[i] = 1.0 / std::max(1e-30, argument_value(network, mass.mass, box.lowest));
    sums[i].stiff = std::max(0.0, argument_value(network, mass.stiffness, box.highest)) *
                    rate_ratio * rate_ratio;
    sums[i].damped =
        2.0 * std::max(0.0, argument_value(network, mass.damping, box.highest)) * rate_ratio;
  }
  for (const Link& link : network.links) {
    const Weight weight = weight_of(network, link, box.highest, rate_ratio);
    for (const std::uint32_t end : {link.a, link.b}) {
      sums[end].stiff += weight.stiff;
      sums[end].damped += weight.damped;
    }
  }
  double factor = 1e9;
  const auto bound = [&](double stiff, double damped) {
    if (stiff > 0.0) {
      factor = std::min(factor, (limit - damped) / stiff);
    } else if (damped > limit) {
      factor = 0.0;
    }
  };
  for (const Link& link : network.links) {
    const double a = inverse_mass[link.a];
    const double b = inverse_mass[link.b];
    bound(sums[link.a].stiff * a + sums[link.b].stiff * b,
          sums[link.a].damped * a + sums[link.b].damped * b);
  }
  for (std::size_t i = 0; i < sums.size(); ++i) {
    bound(sums[i].stiff * inverse_mass[i], sums[i].damped * inverse_mass[i]);
  }
  return factor;
}

}  // namespace ressort
