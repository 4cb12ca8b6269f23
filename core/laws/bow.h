// core/laws: a bow. Its friction rises to 2/9 Z s at |v| = s/3 and falls to 0 at s:
//   |v| < s/3:        f = (Z - Z/3) v
//   s/3 <= |v| < s:   f = sgn(v) (s/3) Z - (Z/3) v
//   else:             f = 0
#pragma once

#include <algorithm>

#include "core/laws/discrete_gradient.h"

namespace ressort::laws {
inline namespace RESSORT_ISA {
inline namespace RESSORT_ROUNDING {

template <class V>
struct Bow {
  static constexpr LawFacts facts = {
      .name = "bow",
      .one = "bow",
      .many = "bows",
      .count = 2,
      .arguments = {{{Role::damping, Unit::friction}, {Role::reach, Unit::speed}}},
      .words = {{{.word = "nlBow",
                  .least = 2,
                  .most = 3,
                  .arguments = "@A @B Z SCALE [PROFILE]",
                  .printed = 2,
                  .velocity_count = 3,
                  .velocity_says = "chooses a bow's profile"}}},
      .zone = Zone::slow,
      .is_friction = true,
      .is_curved = false,
      .is_convex = false,
      .solve_operations = 60.0,
      .faust = R"(
bow(z, s, d, v) =
  select2(abs(v) < s, 0.0, select2(abs(v) < s/3.0, slip, stick)*z)
with {
  stick = 2.0*v/3.0;
  slip = (s*select2(v < 0.0, 1.0, 0.0 - 1.0) - v)/3.0;
};
steady_bow(z, s, now, speed, way) = 0.0, 0.0;
gradient_bow(z, s, b, step) = bow(z, s, 0.0, v),
  select2(abs(v) < s, 0.0, select2(abs(v) < s/3.0, (0.0 - z)/6.0, z/3.0))
with {
  v = 0.5*step;
};
alone_bow(z, s, f, damping, b, speed, way, gamma) =
  side*select2(give > 0.0, select2(remains, 0.0, held), select2(sticks, slipping, held))
with {
  half = 0.5*gamma;
  side = select2(way < 0.0, 1.0, 0.0 - 1.0);
  fast = 0.5*side*way;
  stuck = 1.0 + 2.0*half*z/3.0;
  held = 2.0*z/3.0*fast/stuck;
  give = 1.0 - half*z/3.0;
  slips = (fast - half*s*z/3.0)/give;
  slipping = select2(fast >= s, z/3.0*(s - slips), 0.0);
  sticks = fast < s/3.0*stuck;
  remains =
    sticks & (select2(fast < s, select2(side*speed < slips, 0.0, 1.0), 1.0) > 0.5);
};
)",
  };

  Bow(V z, V s) : stick(z - z / 3), slip(z / 3), inner(s / 3), outer(s), top(s / 3 * z) {}

  // Reads the row that `keep` writes (see LawType in laws.h).
  explicit Bow(const V* kept)
      : stick(kept[0]), slip(kept[1]), inner(kept[2]), outer(kept[3]), top(kept[4]) {}
  void keep(V* row) const {
    row[0] = stick;
    row[1] = slip;
    row[2] = inner;
    row[3] = outer;
    row[4] = top;
  }

  V force(V, V v) const {
    const V fast = absolute(v);
    const V within = stick * v;
    const V beyond = select(v < V{}, -top, top) - slip * v;
    return select(fast < outer, select(fast < inner, within, beyond), V{});
  }
  V potential(V) const { return V{}; }
  V secant(V) const { return V{}; }

  V passive(const LinkState<V>& link) const { return rubbed(*this, link); }
  Steady<V> steady(const LinkState<V>&) const { return {V{}, V{}}; }
  Slope<V> gradient(V, V step) const { return rubbing(*this, step); }

  Slope<V> friction(V v) const {
    const V fast = absolute(v);
    return {force(V{}, v), select(fast < outer, select(fast < inner, stick, -slip), V{})};
  }

  // Returns the friction f(v) at the speed v that solves v + half f(v) = wanted, in closed form.
  // For half Z > 3 there may be three such speeds. The bow then keeps sticking, or slipping, as it
  // did at the speed `last`.
  V grip(V wanted, V last, V half) const {
    const V side = select(wanted < V{}, V{} - 1, V{} + 1);
    const V fast = side * wanted;
    const V stuck = fast / (1 + half * stick);
    const V give = 1 - half * slip;
    const V slipping = (fast - half * top) / give;
    const V torn = inner * (1 + half * stick);  // the bow sticks below this
    const auto sticks = fast < torn;
    const auto is_free = fast >= outer;
    const auto remains = sticks & ((fast < outer) | (side * last < slipping));
    const V steep = select(remains, stick * stuck, V{});
    const V gentle = select(sticks, stick * stuck, select(is_free, V{}, top - slip * slipping));
    return side * select(give > V{}, gentle, steep);
  }

  static Slopes steepest(const Bow&, const Bow& most, double) {
    return {.damping = 2.0 * most.slip};
  }
  static Slopes gentlest(const Bow& least) { return {.damping = std::min(0.0, 3.0 * least.slip)}; }

  V stick;
  V slip;
  V inner;
  V outer;
  V top;  // force of the extended outer slope at v = 0
};

}  // namespace RESSORT_ROUNDING
}  // namespace RESSORT_ISA
}  // namespace ressort::laws
