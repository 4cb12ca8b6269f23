// core/laws: a bow whose profile can change while it sounds: smooth for a profile above 0,
// piecewise linear otherwise.
#pragma once

#include "core/laws/bow.h"
#include "core/laws/smooth_bow.h"

namespace ressort::laws {
inline namespace RESSORT_ISA {
inline namespace RESSORT_ROUNDING {

template <class V>
struct EitherBow {
  static constexpr LawFacts facts = {
      .name = "either_bow",
      .one = "bow",
      .many = "bows",
      .count = 3,
      .arguments = {{{Role::damping, Unit::friction}, {Role::reach, Unit::speed}, {}}},
      .words = {{{.word = "nlBow",
                  .least = 2,
                  .most = 3,
                  .arguments = "@A @B Z SCALE [PROFILE]",
                  .printed = 3}}},
      .is_friction = true,
      .is_convex = false,
      .solve_operations = 360.0,  // both profiles
      .faust = R"(
either_bow(z, s, p, d, v) = select2(p > 0.0, bow(z, s, d, v), smooth_bow(z, s, d, v));
steady_either_bow(z, s, p, now, speed, way) = 0.0, 0.0;
gradient_either_bow(z, s, p, b, step) =
  gradient_bow(z, s, b, step), gradient_smooth_bow(z, s, b, step) : chosen
with {
  chosen(v1, s1, v2, s2) = select2(p > 0.0, v1, v2), select2(p > 0.0, s1, s2);
};
alone_either_bow(z, s, p, f, damping, b, speed, way, gamma) = select2(p > 0.0,
  alone_bow(z, s, f, damping, b, speed, way, gamma),
  alone_smooth_bow(z, s, f, damping, b, speed, way, gamma));
)",
  };

  V force(V d, V v) const {
    return select(profile > V{}, SmoothBow<V>{z, s}.force(d, v), Bow<V>(z, s).force(d, v));
  }
  V potential(V) const { return V{}; }
  V secant(V) const { return V{}; }

  V passive(const LinkState<V>& link) const { return rubbed(*this, link); }
  Steady<V> steady(const LinkState<V>&) const { return {V{}, V{}}; }
  Slope<V> gradient(V, V step) const { return rubbing(*this, step); }

  Slope<V> friction(V v) const {
    const Slope<V> smooth = SmoothBow<V>{z, s}.friction(v);
    const Slope<V> piecewise = Bow<V>(z, s).friction(v);
    return {select(profile > V{}, smooth.value, piecewise.value),
            select(profile > V{}, smooth.slope, piecewise.slope)};
  }
  V grip(V wanted, V last, V half) const {
    const V piecewise = Bow<V>(z, s).grip(wanted, last, half);
    return select(profile > V{}, SmoothBow<V>{z, s}.grip(wanted, last, half), piecewise);
  }

  // The smooth profile has the larger slope.
  static Slopes steepest(const EitherBow&, const EitherBow& most, double) {
    return {.damping = smooth_bow_stick * most.z};
  }
  static Slopes gentlest(const EitherBow& least) { return {.damping = std::min(0.0, least.z)}; }

  V z;
  V s;
  V profile;
};

}  // namespace RESSORT_ROUNDING
}  // namespace RESSORT_ISA
}  // namespace ressort::laws
