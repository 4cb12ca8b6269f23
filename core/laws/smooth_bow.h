// core/laws: a bow with a smooth friction curve, f = 0.63 Z v exp(-4 (v/s)^2 + 1/2)
#pragma once

#include <algorithm>

#include "core/laws/discrete_gradient.h"

namespace ressort::laws {
inline namespace RESSORT_ISA {
inline namespace RESSORT_ROUNDING {

inline constexpr double smooth_bow_stick = 1.0387;  // f/(Z v) at v = 0: 0.63 exp(1/2), rounded up

template <class V>
struct SmoothBow {
  static constexpr LawFacts facts = {
      .name = "smooth_bow",
      .one = "bow",
      .many = "bows",
      .count = 2,
      .arguments = {{{Role::damping, Unit::friction}, {Role::reach, Unit::speed}}},
      .words = {{{.word = "nlBow",
                  .least = 2,
                  .most = 3,
                  .arguments = "@A @B Z SCALE [PROFILE]",
                  .printed = 2,
                  .tail = " 1"}}},
      .is_friction = true,
      .is_convex = false,
      .solve_operations = 300.0,
      .faust = R"(
smooth_bow(z, s, d, v) = 0.63*z*v*exp(0.5 - 4.0*ratio*ratio) with { ratio = v/s; };
steady_smooth_bow(z, s, now, speed, way) = 0.0, 0.0;
gradient_smooth_bow(z, s, b, step) = rubbed(z, s, 0.5*step) : _, *(0.5);
alone_smooth_bow(z, s, f, damping, b, speed, way, gamma) =
  between(24, rubbed(z, s), 0.0, speed, 0.5*way, 0.5*gamma);
rubbed(z, s, v) = grip*v, grip*(1.0 - 8.0*ratio*ratio)
with {
  ratio = min(1000.0, abs(v/s));
  grip = 0.63*z*exp(0.5 - 4.0*ratio*ratio);
};
)",
  };

  V force(V, V v) const {
    using T = Scalar<V>;
    const V ratio = slip(v * per_scale());
    return z * v * T(0.63) * exponential(V{} - 4 * ratio * ratio + T(0.5));
  }
  V potential(V) const { return V{}; }
  V secant(V) const { return V{}; }

  V passive(const LinkState<V>& link) const { return rubbed(*this, link); }
  Steady<V> steady(const LinkState<V>&) const { return {V{}, V{}}; }
  Slope<V> gradient(V, V step) const { return rubbing(*this, step); }

  Curve<V> friction(V v) const { return friction(v, per_scale()); }
  Curve<V> friction(V v, V per_scale) const {
    using T = Scalar<V>;
    const V ratio = slip(v * per_scale);
    const V square = ratio * ratio;
    const V grip = T(0.63) * z * exponential(T(0.5) - 4 * square);
    return {{grip * v, grip * (1 - 8 * square)}, 8 * grip * per_scale * ratio * (8 * square - 3)};
  }

  // Returns the friction f(v) at the speed v that solves v + half f(v) = wanted, by Chebyshev's
  // method from the speed `last`.
  V grip(V wanted, V last, V half) const {
    const V once = per_scale();
    return force_between(V{}, last, wanted, half, [&](V v) { return friction(v, once); });
  }

  static Slopes steepest(const SmoothBow&, const SmoothBow& most, double) {
    return {.damping = smooth_bow_stick * most.z};
  }
  static Slopes gentlest(const SmoothBow& least) { return {.damping = std::min(0.0, least.z)}; }

  // Returns 1/s, or a large number for s = 0.
  V per_scale() const {
    const V least = V{} + Scalar<V>(1e-30);
    return 1 / select(absolute(s) > least, s, least);
  }
  // Returns v/s, clamped to 1000, where the friction is 0.
  static V slip(V ratio) {
    const V most = V{} + 1000;
    return select(absolute(ratio) < most, ratio, most);
  }

  V z;
  V s;
};

}  // namespace RESSORT_ROUNDING
}  // namespace RESSORT_ISA
}  // namespace ressort::laws
