// core/laws: a cubic spring, f = K d + Q d^3 + Z v
#pragma once

#include "core/laws/spring.h"

namespace ressort::laws {
inline namespace RESSORT_ISA {
inline namespace RESSORT_ROUNDING {

template <class V>
struct CubicSpring {
  static constexpr LawFacts facts = {
      .name = "cubic_spring",
      .one = "nonlinear spring",
      .many = "nonlinear springs",
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
      .solve_operations = 120.0,
      .faust = R"(
cubic_spring(k, q, z, d, v) = spring(k, z, d, v) + q*d*d*d;
steady_cubic_spring(k, q, z, now, speed, way) = 0.0, 0.5*z;
gradient_cubic_spring(k, q, z, b, s) = k*(b + 0.5*s) + 0.25*q*(a + b)*(a*a + b*b),
  0.5*k + 0.25*q*(3.0*a*a + 2.0*a*b + b*b)
with {
  a = b + s;
};
)",
  };

  V force(V d, V v) const { return k * d + q * d * d * d + z * v; }
  V potential(V d) const {
    using T = Scalar<V>;
    return T(0.5) * k * d * d + T(0.25) * q * d * d * d * d;
  }
  V secant(V d) const { return k + q * d * d; }

  // The potential of Q d^3 alone.
  V curved(V d) const { return Scalar<V>(0.25) * q * d * d * d * d; }

  // f = K now + Z (now - before) + the discrete gradient of Q/4 d^4, which is
  // Q/4 (after + before) (after^2 + before^2), free of cancellation. Newton's method starts at the
  // solution with the approximation Q now^2 (after + before)/2. The function has one inflection
  // point, so the iteration overshoots at most once.
  V passive(const LinkState<V>& link) const {
    const Steady<V> linear = steady(link);
    const V b = link.before();
    const V square = b * b;
    const V free = link.free - link.gamma * linear.force;
    const V bent = link.gamma * q * link.now * link.now / 2;
    const V g = link.gamma * q / 4;
    V a = (free - bent * b) / (1 + bent);
    auto live = a == a;
    for (int i = 0; i < most_newton_steps && any_of(live); ++i) {
      const V over = a - free + g * (a + b) * (a * a + square);
      const V way = over / (1 + g * (3 * a * a + 2 * a * b + square));
      a = select(live, a - way, a);
      live = live & (absolute(way) > Scalar<V>(0x1p-18) * (absolute(a) + absolute(b)));
    }
    const Slope<V> bend = gradient(b, a - b);
    const V over = a - free + link.gamma * bend.value;
    return linear.force + bend.value - bend.slope * over / (1 + link.gamma * bend.slope);
  }
  Steady<V> steady(const LinkState<V>& link) const { return {k * link.now + z * link.speed, V{}}; }
  Slope<V> gradient(V b, V step) const {
    const V a = b + step;
    const V square = b * b;
    return {q / 4 * (a + b) * (a * a + square), q / 4 * (3 * a * a + 2 * a * b + square)};
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

}  // namespace RESSORT_ROUNDING
}  // namespace RESSORT_ISA
}  // namespace ressort::laws
