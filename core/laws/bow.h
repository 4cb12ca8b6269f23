// core/laws: friction that rises to 2/9 Z s at |v| = s/3 and falls to 0 at s:
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
      .family = Family::bow,
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
      .is_curved = false,
      .is_convex = false,
      .solve_ns = 15.0,
      .faust =
          "bow(z, s, d, v) =\n"
          "  select2(abs(v) < s*r, 0.0, select2(abs(v) < s*r/3.0, slip, stick)*z*r)\n"
          "with {\n"
          "  stick = 2.0*v/3.0;\n"
          "  slip = (s*r*select2(v < 0.0, 1.0, 0.0 - 1.0) - v)/3.0;\n"
          "};\n",
  };

  Bow(V z, V s) : stick(z - z / 3), slip(z / 3), inner(s / 3), outer(s), top(s / 3 * z) {}

  // As a row of numbers that a kernel keeps, instead of its arguments.
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

  // The friction f(v) at the speed v that solves v + half f(v) = wanted, in closed form. For
  // half Z > 3 there may be three such speeds: it goes on to stick, or to slip, as it did at the
  // speed `last`.
  V grip(V wanted, V last, V half) const {
    const V side = select(wanted < V{}, V{} - 1, V{} + 1);
    const V fast = side * wanted;
    const V stuck = fast / (1 + half * stick);
    const V give = 1 - half * slip;
    const V slipping = (fast - half * top) / give;
    const V torn = inner * (1 + half * stick);  // where sticking ends
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
  V top;  // where the outer slopes would meet at 0
};

}  // namespace RESSORT_ROUNDING
}  // namespace RESSORT_ISA
}  // namespace ressort::laws
