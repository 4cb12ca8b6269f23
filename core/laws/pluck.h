// core/laws: a repulsive triangle: slope 0.9 K up to |d| = s/10, then falling with K/10 to 0 at
// |d| = s:
//   |d| < s/10:        f = -(K - K/10) d + Z v
//   s/10 <= |d| < s:   f = -sgn(d) (s/10) K + (K/10) d + Z v
//   else:              f = 0
#pragma once

#include <algorithm>

#include "core/laws/discrete_gradient.h"

namespace ressort::laws {
inline namespace RESSORT_ISA {

template <class V>
struct Pluck {
  static constexpr LawFacts facts = {
      .name = "pluck",
      .family = Family::pluck,
      .one = "pluck",
      .many = "plucks",
      .count = 3,
      .arguments = {{{Role::stiffness, Unit::stiffness},
                     {Role::reach, Unit::plain},
                     {Role::damping, Unit::damping}}},
      .words = {{{.word = "nlPluck",
                  .least = 2,
                  .most = 3,
                  .arguments = "@A @B K SCALE [Z]",
                  .printed = 3,
                  .velocity_count = 3,
                  .velocity_says = "gives a pluck a damping"}}},
      .zone = Zone::near,
      .is_curved = false,
      .has_discrete_gradient = false,
      .solve_ns = 15.0,
      .substep_ns = 5.5,
      .faust =
          "pluck(k, s, z, d, v) =\n"
          "  select2(abs(d) < s, 0.0, select2(abs(d) < s/10.0, outer, inner)*k*r*r + z*r*v)\n"
          "with {\n"
          "  inner = 0.0 - 0.9*d;\n"
          "  outer = d/10.0 - s/10.0*select2(d < 0.0, 1.0, 0.0 - 1.0);\n"
          "};\n",
  };

  Pluck(V k, V s, V z_in)
      : rise(k - k / 10), fall(k / 10), inner(s / 10), outer(s), top(s / 10 * k), z(z_in) {}

  // As a row of numbers that a kernel keeps, instead of its arguments.
  explicit Pluck(const V* kept)
      : rise(kept[0]), fall(kept[1]), inner(kept[2]), outer(kept[3]), top(kept[4]), z(kept[5]) {}
  void keep(V* row) const {
    row[0] = rise;
    row[1] = fall;
    row[2] = inner;
    row[3] = outer;
    row[4] = top;
    row[5] = z;
  }

  V force(V d, V v) const {
    const V far = absolute(d);
    const V within = -rise * d;
    const V beyond = fall * d - select(d < V{}, -top, top);
    return select(far < outer, select(far < inner, within, beyond) + z * v, V{});
  }
  V potential(V d) const {
    const V far = absolute(d);
    const V slope = outer - select(far < inner, inner, far);
    const V hill = select(far < inner, rise / 2 * (inner * inner - d * d), V{});
    return select(far < outer, fall / 2 * slope * slope + hill, V{});
  }
  V secant(V) const { return fall; }

  // Its force falls as steeply as it wants to snap, and a finger may pass in a sample: always in
  // substeps.
  Push<V> passive(const LinkState<V>& link, int substeps) const {
    const V curve = absolute(link.fast - link.speed);
    const V now = absolute(link.now);
    const V free = absolute(link.free);
    const auto may_touch =
        (select(now < free, now, free) < outer + curve) | (link.now * link.free < V{});
    if (!any_of(may_touch)) {
      return {V{}, V{}};
    }
    return substep(link, substeps, [&](V d, V v, V, V) { return force(d, v); });
  }

  // It pulls beyond its top; a negative one pulls below it.
  static Slopes steepest(const Pluck& least, const Pluck& most, double) {
    return {.stiffness = 9.0 * std::max(most.fall, -least.fall),
            .damping = most.z,
            .pull = std::max(most.fall, -9.0 * least.fall)};
  }
  static Slopes gentlest(const Pluck& least) { return {.damping = std::min(0.0, least.z)}; }

  V rise;
  V fall;
  V inner;
  V outer;
  V top;  // where the outer slopes would meet at 0
  V z;
};

}  // namespace RESSORT_ISA
}  // namespace ressort::laws
