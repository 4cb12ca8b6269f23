// core/laws: a contact by a power law, for felt, rubber or balls (Hunt and Crossley, J. Appl. Mech.
// 42, 1975). The damping grows with the depth like the stiffness, so the force does not jump at the
// first touch. With D = d + t and an exponent P, clamped to at least 1:
//   d > -t: f = (K + Z v) D^P, else 0
// P is 1.5 for steel and wood (Hertz), and 2.3 to 3.5 for piano hammers.
#pragma once

#include <algorithm>
#include <cmath>

#include "core/laws/discrete_gradient.h"

namespace ressort::laws {
inline namespace RESSORT_ISA {
inline namespace RESSORT_ROUNDING {

// The power of a depth. `const`, because the compiler computes equal calls once and moves constant
// ones out of loops. It may not do so with std::pow(), which sets errno.
template <class V>
[[gnu::const, gnu::noinline]] static V depth_power(V depth, V p) noexcept {
  return power(depth, p);
}

// The potential K/(P + 1) D^(P + 1), its force K D^P and its slope K P D^(P - 1).
template <class V>
struct PowerWall {
  V energy(V d) const { return k / (p + 1) * depth(d) * depth_power(depth(d), p); }
  V force(V d) const { return k * depth_power(depth(d), p); }
  V slope(V d) const {
    const auto is_in = d > V{};
    return select(is_in, p * force(d) / select(is_in, d, V{} + 1), V{});
  }
  static V depth(V d) { return select(d > V{}, d, V{}); }
  V k;
  V p;
};

template <class V>
struct PowerContact {
  static constexpr LawFacts facts = {
      .name = "power_contact",
      .one = "power-law contact",
      .many = "power-law contacts",
      .count = 4,
      .arguments = {{{Role::stiffness, Unit::stiffness},
                     {.role = Role::shape, .unit = Unit::plain, .least = 1.0, .most = 5.0},
                     {Role::damping, Unit::damping},
                     {Role::reach, Unit::plain}}},
      .words = {{{.word = "powerContact",
                  .least = 2,
                  .most = 4,
                  .arguments = "@A @B K P [Z [THRESHOLD]]",
                  .printed = 4}}},
      .zone = Zone::below,
      .is_odd = false,
      .solve_operations = 1000.0,  // by Newton's method, with powers lane by lane
      .faust = R"(
power_contact(k, p, z, t, d, v) =
  (k + z*v)*select2(d > 0.0 - t, 0.0, pow(max(d + t, 1e-300), max(p, 1.0)));
steady_power_contact(k, p, z, t, now, speed, way) = 0.0,
  0.5*z*select2(now + t > 0.0, 0.0, pow(max(now + t, 1e-300), max(p, 1.0)));
gradient_power_contact(k, p, z, t, b) = discrete(energy, force, slope, b + t)
with {
  n = max(p, 1.0);
  deep(d, a) = select2(d > 0.0, 0.0, pow(max(d, 1e-300), a));
  energy(d) = k/(n + 1.0)*deep(d, n + 1.0);
  force(d) = k*deep(d, n);
  slope(d) = k*n*deep(d, n - 1.0);
};
)",
  };

  V force(V d, V v) const {
    return select(d > -t, (k + z * v) * power(wall().depth(d + t), exponent()), V{});
  }
  V potential(V d) const { return wall().energy(d + t); }
  V secant(V d) const { return k * power(wall().depth(d + t), exponent() - 1); }

  // The discrete gradient of the potential, and the damper at the current depth.
  V passive(const LinkState<V>& link) const {
    if (!may_touch(link, t)) {
      return V{};
    }
    return damped_force(wall(), link.before() + t, link.free + t, link.gamma, steady(link).damping);
  }
  Steady<V> steady(const LinkState<V>& link) const {
    return {V{}, may_touch(link, t) ? z / 2 * power(wall().depth(link.now + t), exponent()) : V{}};
  }
  Slope<V> gradient(V before, V step) const { return discrete_gradient(wall(), before + t, step); }

  // The slope grows without bound, so `within` limits the depth.
  static Slopes steepest(const PowerContact& least, const PowerContact& most, double within) {
    const double depth = std::max(0.0, within + most.t);
    // For D < 1, P D^(P - 1) is largest at P = -1/ln D. For D >= 1 it grows with P.
    const double low = std::max(1.0, least.p);
    const double high = std::max(1.0, most.p);
    const double p = depth < 1.0 ? std::clamp(-1.0 / std::log(depth), low, high) : high;
    const double steep = p * std::pow(depth, p - 1.0);
    const double damping = most.z * std::max(std::pow(depth, low), std::pow(depth, high));
    return {.stiffness = most.k * steep, .damping = damping, .pull = most.k * steep};
  }
  static Slopes gentlest(const PowerContact& least) {
    return {.damping = std::min(0.0, least.z), .pull = std::min(0.0, least.k)};
  }

  V k;
  V p;
  V z;
  V t;

 private:
  V exponent() const { return select(p > V{} + 1, p, V{} + 1); }
  PowerWall<V> wall() const { return {k, exponent()}; }
};

}  // namespace RESSORT_ROUNDING
}  // namespace RESSORT_ISA
}  // namespace ressort::laws
