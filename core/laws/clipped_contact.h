// core/laws: a contact whose force is that of a clipped spring, without the extra damping. With
// D = d + t, and s instead of k if k < s:
//   d > -t: f = s D + c D^3 + Z v up to |D| = sqrt((k - s)/c), then k D + Z v; else 0
#pragma once

#include "core/laws/clipped_spring.h"

namespace ressort::laws {
inline namespace RESSORT_ISA {
inline namespace RESSORT_ROUNDING {

// The potential of a clipped spring for d > 0, and 0 elsewhere.
template <class V>
struct ClippedWall {
  V energy(V d) const { return select(d > V{}, inside.energy(d), V{}); }
  V force(V d) const { return select(d > V{}, inside.force(d), V{}); }
  V slope(V d) const { return select(d > V{}, inside.slope(d), V{}); }
  ClippedPotential<V> inside;
};

template <class V>
struct ClippedContact {
  static constexpr LawFacts facts = {
      .name = "clipped_contact",
      .one = "contact",
      .many = "contacts",
      .count = 5,
      .arguments = {{{Role::stiffness, Unit::stiffness},
                     {Role::bend, Unit::stiffness},
                     {Role::limit, Unit::stiffness},
                     {Role::damping, Unit::damping},
                     {Role::reach, Unit::plain}}},
      .words = {{{.word = "nlContact",
                  .least = 4,
                  .most = 5,
                  .arguments = "@A @B S C K Z [THRESHOLD]",
                  .printed = 5,
                  .velocity_count = -1,
                  .velocity_says = "has 'nlContact'"}}},
      .zone = Zone::below,
      .is_odd = false,
      .solve_operations = 320.0,  // by Newton's method
      .faust = R"(
clipped_contact(s, c, k, z, t, d, v) = select2(d > 0.0 - t, 0.0, elastic + z*v)
with {
  depth = d + t;
  elastic = select2(k < s, select2(c == 0.0, bent, s*depth), s*depth);
  bent = select2(c > 0.0, k*depth, select2(c*depth*depth <= k - s, k*depth, cubic));
  cubic = s*depth + c*depth*depth*depth;
};
steady_clipped_contact(s, c, k, z, t, now, speed, way) = 0.0,
  0.5*z*inside(now - speed + t, now + t, now - speed + way + t);
gradient_clipped_contact(s, c, k, z, t, b) =
  discrete(wall(clipped_energy(low, bend, high)), wall(clipped_force(low, bend, high)),
    wall(clipped_slope(low, bend, high)), b + t)
with {
  wall(g, d) = select2(d > 0.0, 0.0, g(d));
  is_bent = (c > 0.0) & (k >= s);
  straight = select2(k < s, select2(c == 0.0, k, s), s);
  low = select2(is_bent, straight, s);
  bend = select2(is_bent, 0.0, c);
  high = select2(is_bent, straight, k);
};
)",
  };

  V force(V d, V v) const {
    const V depth = d + t;
    const V cubic = s * depth + c * depth * depth * depth;
    const V clipped = k * depth;
    const V bent = select(c > V{}, select(c * depth * depth <= k - s, cubic, clipped), clipped);
    const V elastic = select(k < s, s * depth, select(c == V{}, s * depth, bent));
    return select(d > -t, elastic + z * v, V{});
  }
  V potential(V d) const { return wall().energy(d + t); }
  V secant(V) const { return k; }

  // The discrete gradient of the potential, and a damper for the time of the touch.
  V passive(const LinkState<V>& link) const {
    if (!may_touch(link, t)) {
      return V{};
    }
    return damped_force(wall(), link.before() + t, link.free + t, link.gamma, steady(link).damping);
  }
  Steady<V> steady(const LinkState<V>& link) const {
    return {V{}, may_touch(link, t) ? z / 2 * share_inside(link, t) : V{}};
  }
  Slope<V> gradient(V before, V step) const { return discrete_gradient(wall(), before + t, step); }

  static Slopes steepest(const ClippedContact& least, const ClippedContact& most, double) {
    const bool is_bent = least.c != 0.0 || most.c != 0.0;
    const double stiffness = clipped_stiffness(least.s, most.s, is_bent, most.k);
    return {.stiffness = stiffness, .damping = most.z, .pull = stiffness};
  }
  static Slopes gentlest(const ClippedContact& least) {
    return {.damping = std::min(0.0, least.z), .pull = std::min(0.0, least.k)};
  }

  V s;
  V c;
  V k;
  V z;
  V t;

 private:
  ClippedWall<V> wall() const {
    const auto is_bent = (c > V{}) & (k >= s);
    const V straight = select((k < s) | (c == V{}), s, k);
    return {{select(is_bent, s, straight), select(is_bent, c, V{}), select(is_bent, k, straight)}};
  }
};

}  // namespace RESSORT_ROUNDING
}  // namespace RESSORT_ISA
}  // namespace ressort::laws
