// core/laws: a quadratic spring, f = K d + Q sgn(d) d^2 + Z v
#pragma once

#include "core/laws/spring.h"

namespace ressort::laws {
inline namespace RESSORT_ISA {
inline namespace RESSORT_ROUNDING {

template <class V>
struct QuadraticSpring {
  static constexpr LawFacts facts = {
      .name = "quadratic_spring",
      .one = "nonlinear spring",
      .many = "nonlinear springs",
      .count = 3,
      .arguments = {{{Role::stiffness, Unit::stiffness},
                     {Role::bend, Unit::stiffness},
                     {Role::damping, Unit::damping}}},
      .words =
          {{{.word = "nlSpring2", .least = 3, .most = 3, .arguments = "@A @B K Q Z", .printed = 3},
            {.word = "nlSpring", .least = 3, .most = 3, .arguments = "@A @B K Q Z"}}},
      .contains_spring = true,
      .solve_operations = 320.0,  // by Newton's method
      .faust = R"(
quadratic_spring(k, q, z, d, v) = spring(k, z, d, v) + q*d*abs(d);
steady_quadratic_spring(k, q, z, now, speed, way) = 0.0, 0.5*z;
gradient_quadratic_spring(k, q, z, b, s) = k*(b + 0.5*s) + side*f,
  0.5*k + select2(crosses, q/3.0*(a + a + c), (q*a*a - f)/both)
with {
  after = b + s;
  a = abs(after);
  c = abs(b);
  crosses = after*b < 0.0;
  side = select2(select2(crosses, after + b, after) < 0.0, 1.0, 0.0 - 1.0);
  both = select2(crosses, 1.0, a + c);
  f = q/3.0*(a*a + a*c + c*c)*select2(crosses, 1.0, (a - c)/both);
};
)",
  };

  V force(V d, V v) const { return k * d + q * d * absolute(d) + z * v; }
  V potential(V d) const { return Scalar<V>(0.5) * k * d * d + curved(d); }
  V secant(V d) const { return k + q * absolute(d); }

  // The potential of Q sgn(d) d^2 alone.
  V curved(V d) const { return q / Scalar<V>(3.0) * absolute(d * d * d); }

  // f = K now + Z (now - before) + the discrete gradient of Q/3 |d|^3, which is
  // sgn(after) Q/3 (a^2 + a b + b^2) with a = |after| and b = |before|, times (a - b)/(a + b) if
  // the signs differ. This form is free of cancellation.
  V passive(const LinkState<V>& link) const {
    const V linear = steady(link).force;
    const V before = link.before();
    return linear + rising_force(link.free - link.gamma * linear, link.gamma,
                                 [&](V after) { return gradient(before, after - before); });
  }
  Steady<V> steady(const LinkState<V>& link) const { return {k * link.now + z * link.speed, V{}}; }
  Slope<V> gradient(V before, V step) const {
    const V after = before + step;
    const V a = absolute(after);
    const V b = absolute(before);
    const V square = q / 3 * (a * a + a * b + b * b);
    const auto crosses = after * before < V{};
    const V side = select(select(crosses, after, after + before) < V{}, V{} - 1, V{} + 1);
    const V both = select(crosses, a + b, V{} + 1);
    const V f = square * select(crosses, (a - b) / both, V{} + 1);
    return {side * f, select(crosses, (q * a * a - f) / both, q / 3 * (a + a + b))};
  }

  static Slopes steepest(const QuadraticSpring&, const QuadraticSpring& most, double within) {
    const double k = most.k + (within > 0.0 ? 2.0 * most.q * within : 0.0);
    return {.stiffness = k, .damping = most.z, .pull = k};
  }
  static Slopes gentlest(const QuadraticSpring& least) {
    return {.damping = least.z, .pull = least.k};
  }

  V k;
  V q;
  V z;
};

}  // namespace RESSORT_ROUNDING
}  // namespace RESSORT_ISA
}  // namespace ressort::laws
