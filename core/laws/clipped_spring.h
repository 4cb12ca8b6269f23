// core/laws: a cubic spring whose secant stiffness grows from s to at most k, which it reaches at
// |d| = b = sqrt((k - s)/c). Beyond b the damping is larger. mi.lib has b = sqrt(k - s)/c, where
// the force jumps; here it is continuous.
//   c = 0:      f = s d + Z v
//   s >= k:     f = k d + Z v
//   |d| <= b:   f = s d + c d^3 + Z v
//   else:       f = k d + (Z + 0.3 k) v
#pragma once

#include <algorithm>

#include "core/laws/discrete_gradient.h"

namespace ressort::laws {
inline namespace RESSORT_ISA {
inline namespace RESSORT_ROUNDING {

// The potential: s d^2/2 + c d^4/4 up to b, then k d^2/2 - (k - s)^2/4c, which is continuous at b.
// A plain spring has c = 0 and k = s.
template <class V>
struct ClippedPotential {
  ClippedPotential(V s_in, V c_in, V k_in)
      : s(s_in),
        c(c_in),
        k(k_in),
        less(select(c > V{}, (k - s) * (k - s) / select(c > V{}, 4 * c, V{} + 1), V{})) {}
  V energy(V d) const {
    const V square = d * d;
    return select(c * square <= k - s, square * (s / 2 + c / 4 * square), k / 2 * square - less);
  }
  V force(V d) const {
    const V square = c * d * d;
    return select(square <= k - s, s + square, k) * d;
  }
  V slope(V d) const {
    const V square = c * d * d;
    return select(square <= k - s, s + 3 * square, k);
  }
  V s;
  V c;
  V k;
  V less;
};

// Returns the largest slope of s d + c d^3 before the clip at k. At b, where c b^2 = k - s, the
// slope is s + 3 c b^2 = 3 k - 2 s. The bound holds for ranges of all arguments, so it must not
// fall with k or c: if c may differ from 0, it is the larger of s and 3 k - 2 s.
inline double clipped_stiffness(double least_s, double most_s, bool is_bent, double most_k) {
  return is_bent ? std::max(most_s, 3.0 * most_k - 2.0 * least_s) : most_s;
}

template <class V>
struct ClippedSpring {
  static constexpr LawFacts facts = {
      .name = "clipped_spring",
      .one = "nonlinear spring",
      .many = "nonlinear springs",
      .count = 4,
      .arguments = {{{Role::stiffness, Unit::stiffness},
                     {Role::bend, Unit::stiffness},
                     {Role::limit, Unit::stiffness},
                     {Role::damping, Unit::damping}}},
      .words = {{{.word = "nlSpringDamper",
                  .least = 4,
                  .most = 4,
                  .arguments = "@A @B S C K Z",
                  .printed = 4,
                  .velocity_count = -1,
                  .velocity_says = "has 'nlSpringDamper'"}}},
      .solve_operations = 320.0,  // by Newton's method
      .faust = R"(
clipped_spring(s, c, k, z, d, v) =
  select2(c == 0.0, select2(s >= k, bent, spring(k, z, d, v)), spring(s, z, d, v))
with {
  bent = select2(c > 0.0, beyond, select2(c*d*d <= k - s, beyond, within));
  within = spring(s, z, d, v) + c*d*d*d;
  beyond = spring(k, z + 0.3*k, d, v);
};
steady_clipped_spring(s, c, k, z, now, speed, way) = 0.0,
  0.5*select2(c == 0.0, select2(s >= k, select2(c > 0.0, beyond, bent), z), z)
with {
  beyond = z + 0.3*k;
  bent = select2(c*now*now <= k - s, beyond, z);
};
gradient_clipped_spring(s, c, k, z) = discrete(clipped_energy(low, bend, high),
  clipped_force(low, bend, high), clipped_slope(low, bend, high))
with {
  is_bent = (c > 0.0) & (s < k);
  low = select2(is_bent, high, s);
  bend = select2(is_bent, 0.0, c);
  high = select2(c == 0.0, k, s);
};
clipped_energy(s, c, k, d) =
  select2(c*d*d <= k - s, 0.5*k*d*d - less, d*d*(0.5*s + 0.25*c*d*d))
with {
  less = select2(c > 0.0, 0.0, (k - s)*(k - s)/select2(c > 0.0, 1.0, 4.0*c));
};
clipped_force(s, c, k, d) = d*select2(c*d*d <= k - s, k, s + c*d*d);
clipped_slope(s, c, k, d) = select2(c*d*d <= k - s, k, s + 3.0*c*d*d);
)",
  };

  V force(V d, V v) const {
    using T = Scalar<V>;
    const V within = s * d + c * d * d * d + z * v;
    const V beyond = k * d + (z + T(0.3) * k) * v;
    const V cubic = select(c > V{}, select(c * d * d <= k - s, within, beyond), beyond);
    return select(c == V{}, s * d + z * v, select(s >= k, k * d + z * v, cubic));
  }
  V potential(V d) const { return elastic().energy(d); }
  V secant(V) const { return k; }

  // The discrete gradient of the potential, and the damper at the current distance.
  V passive(const LinkState<V>& link) const {
    return damped_force(elastic(), link.before(), link.free, link.gamma, steady(link).damping);
  }
  Steady<V> steady(const LinkState<V>& link) const {
    const V beyond = z + Scalar<V>(0.3) * k;
    const V bent = select(c * link.now * link.now <= k - s, z, beyond);
    return {V{}, select(c == V{}, z, select(s >= k, z, select(c > V{}, bent, beyond))) / 2};
  }
  Slope<V> gradient(V before, V step) const { return discrete_gradient(elastic(), before, step); }

  static Slopes steepest(const ClippedSpring& least, const ClippedSpring& most, double) {
    const bool is_bent = least.c != 0.0 || most.c != 0.0;
    const double stiffness = clipped_stiffness(least.s, most.s, is_bent, most.k);
    const double extra = is_bent ? 0.3 * most.k : 0.0;
    return {.stiffness = stiffness,
            .damping = most.z,
            .stiff_damping = extra,
            .pull = std::max(stiffness, is_bent ? most.k + 2.0 * extra : 0.0)};
  }
  // For c <= 0 the smaller of s and k bounds the stiffness; otherwise the outer one, k, does.
  static Slopes gentlest(const ClippedSpring& least) {
    const double far = least.c <= 0.0 ? std::min(least.s, least.k) : least.k;
    return {.damping = std::min(0.0, least.z), .pull = std::min(0.0, far)};
  }

  V s;
  V c;
  V k;
  V z;

 private:
  ClippedPotential<V> elastic() const {
    const auto is_bent = (c > V{}) & (s < k);
    const V straight = select(c == V{}, s, k);
    return {select(is_bent, s, straight), select(is_bent, c, V{}), select(is_bent, k, straight)};
  }
};

}  // namespace RESSORT_ROUNDING
}  // namespace RESSORT_ISA
}  // namespace ressort::laws
