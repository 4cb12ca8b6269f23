// core/laws: a spring with a damper, f = K d + Z v. This is the only linear law.
#pragma once

#include "core/laws/discrete_gradient.h"

namespace ressort::laws {
inline namespace RESSORT_ISA {
inline namespace RESSORT_ROUNDING {

template <class V>
struct Spring {
  static constexpr LawFacts facts = {
      .name = "spring",
      .one = "spring",
      .many = "springs",
      .count = 2,
      .arguments = {{{Role::stiffness, Unit::stiffness}, {Role::damping, Unit::damping}}},
      .words =
          {{{.word = "spring", .least = 1, .most = 2, .arguments = "@A @B K [Z]", .printed = 1},
            {.word = "damper",
             .least = 1,
             .most = 1,
             .arguments = "@A @B Z",
             .first = 1,
             .printed = 1},
            {.word = "springDamper",
             .least = 1,
             .most = 2,
             .arguments = "@A @B K [Z]",
             .printed = 2},
            {.word = "springDamperDamper", .least = 1, .most = 2, .arguments = "@A @B K [Z]"}}},
      .contains_spring = true,
      .is_curved = false,
      .solve_operations = 64.0,
      .faust = R"(
spring(k, z, d, v) = k*d + z*v;
steady_spring(k, z, now, speed, way) = 0.0, 0.5*z;
gradient_spring(k, z, b, s) = k*(b + 0.5*s), 0.5*k;
alone_spring(k, z, f, damping, b, speed, way, gamma) = (k*b + h*way)/(1.0 + h*gamma)
with {
  h = 0.5*k + damping;
};
)",
  };

  V force(V d, V v) const { return k * d + z * v; }
  V potential(V d) const { return Scalar<V>(0.5) * k * d * d; }
  V secant(V) const { return k; }

  // f = K (after + before)/2 + Z (after - before)/2
  V passive(const LinkState<V>& link) const {
    const V later = (k + z) / 2;
    return (later * link.free + (k - z) / 2 * link.before()) / (1 + link.gamma * later);
  }
  Steady<V> steady(const LinkState<V>&) const { return {V{}, z / 2}; }
  Slope<V> gradient(V before, V step) const { return {k * (before + step / 2), k / 2}; }

  static Slopes steepest(const Spring&, const Spring& most, double) {
    return {.stiffness = most.k, .damping = most.z, .pull = most.k};
  }
  static Slopes gentlest(const Spring& least) { return {.damping = least.z, .pull = least.k}; }

  V k;
  V z;
};

}  // namespace RESSORT_ROUNDING
}  // namespace RESSORT_ISA
}  // namespace ressort::laws
