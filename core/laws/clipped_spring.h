// core/laws: a cubic spring whose stiffness s grows no further than k, at |d| = b = sqrt((k -
// s)/c); beyond b it is damped more. mi.lib's b is sqrt(k - s)/c, where the force jumps; this one
// is continuous.
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

// s d^2/2 + c d^4/4 up to b, where the force is that of k, then k d^2/2 and as much less as both
// differ there, (k - s)^2/4c. A plain spring is one with c = 0 and k = s.
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

// How steep s d + c d^3 becomes before it is clipped at k: at b, where c b^2 = k - s, its tangent
// is s + 3 c b^2 = 3 k - 2 s. As a bound over all arguments it must not fall with any of them but
// s: that is why s and 3 k - 2 s count wherever c may not be 0.
inline double clipped_stiffness(double least_s, double most_s, bool is_bent, double most_k) {
  return is_bent ? std::max(most_s, 3.0 * most_k - 2.0 * least_s) : most_s;
}

template <class V>
struct ClippedSpring {
  static constexpr LawFacts facts = {
      .name = "clipped_spring",
      .family = Family::spring,
      .one = "spring that bends",
      .many = "springs that bend",
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
      .solve_ns = 80.0,  // by Newton
      .faust =
          "clipped_spring(s, c, k, z, d, v) =\n"
          "  select2(c == 0.0, select2(s >= k, bent, spring(k, z, d, v)), spring(s, z, d, v))\n"
          "with {\n"
          "  bent = select2(c > 0.0, beyond, select2(c*d*d <= k - s, beyond, within));\n"
          "  within = spring(s, z, d, v) + c*r*r*d*d*d;\n"
          "  beyond = spring(k, z + 0.3*k*r, d, v);\n"
          "};\n",
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

  // The potential's discrete gradient, and the damper of now.
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
  // From 0 on it may push as long as it pulls further out.
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
