// core/laws: f = K d + Q d^3 + Z v
#pragma once

#include "core/laws/spring.h"

namespace ressort::laws {
inline namespace RESSORT_ISA {

template <class V>
struct CubicSpring {
  static constexpr LawFacts facts = {
      .name = "cubic_spring",
      .family = Family::spring,
      .one = "spring that grows stiffer",
      .many = "springs that grow stiffer",
      .count = 3,
      .arguments = {{{Role::stiffness, Unit::stiffness},
                     {Role::bend, Unit::stiffness},
                     {Role::damping, Unit::damping}}},
      .words = {{{.word = "nlSpring3",
                  .least = 3,
                  .most = 3,
                  .arguments = "@A @B K Q Z",
                  .printed = 3}}},
      .contains_spring = true,
      .solve_ns = 16.0,
      .faust = "cubic_spring(k, q, z, d, v) = spring(k, z, d, v) + q*r*r*d*d*d;\n",
  };

  V force(V d, V v) const { return k * d + q * d * d * d + z * v; }
  V potential(V d) const {
    using T = Scalar<V>;
    return T(0.5) * k * d * d + T(0.25) * q * d * d * d * d;
  }
  V secant(V d) const { return k + q * d * d; }

  // What is curved holds this from one sample to the next; the rest holds what a spring does.
  V curved_energy(V now, V before) const {
    return Scalar<V>(0.25) * q * now * now * before * before;
  }

  // f = K now + Z (now - before) + Q now^2 (after + before)/2: linearly implicit.
  Push<V> passive(const LinkState<V>& link, int) const {
    const V bent = q * link.now * link.now / 2;
    const V linear = k * link.now + z * link.speed;
    return at_once((linear + bent * (link.free + link.before())) / (1 + link.gamma * bent));
  }

  static Slopes steepest(const CubicSpring&, const CubicSpring& most, double within) {
    const double k = most.k + (within > 0.0 ? 3.0 * most.q * within * within : 0.0);
    return {.stiffness = k, .damping = most.z, .pull = k};
  }
  static Slopes gentlest(const CubicSpring& least) { return {.damping = least.z, .pull = least.k}; }

  V k;
  V q;
  V z;
};

}  // namespace RESSORT_ISA
}  // namespace ressort::laws
