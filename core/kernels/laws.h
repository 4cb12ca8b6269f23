// core/engine: the force laws, in one place.
//
// For a link from a to b: d = x_a - x_b, and v = the same difference of the velocities, both in
// position units and position units per sample. A law gives f; the step applies F_a -= f and
// F_b += f, so a positive f for a positive d attracts.
//
// The laws are those of mi.lib since 2020 (Leonard, Villeneuve, Michon), in their current form.
#pragma once

#include "core/kernels/lanes.h"
#include "core/kernels/program.h"

namespace ressort {

// f = K d + Z v
template <class V>
static inline V spring_force(V d, V v, V k, V z) {
  return k * d + z * v;
}

// f = K d + Q sgn(d) d^2 + Z v
template <class V>
static inline V quadratic_spring_force(V d, V v, V k, V q, V z) {
  return k * d + q * d * absolute(d) + z * v;
}

// f = K d + Q d^3 + Z v
template <class V>
static inline V cubic_spring_force(V d, V v, V k, V q, V z) {
  return k * d + q * d * d * d + z * v;
}

// A cubic spring whose stiffness s grows no further than k, at |d| = b = sqrt((k - s)/c); beyond
// b it is damped more. mi.lib's b is sqrt(k - s)/c, where the force jumps; this one is continuous.
//   c = 0:      f = s d + Z v
//   s >= k:     f = k d + Z v
//   |d| <= b:   f = s d + c d^3 + Z v
//   else:       f = k d + (Z + 0.3 k) v
template <class V>
static inline V clipped_spring_force(V d, V v, V s, V c, V k, V z) {
  using T = Scalar<V>;
  const V within = s * d + c * d * d * d + z * v;
  const V beyond = k * d + (z + T(0.3) * k) * v;
  const V cubic = select(c > V{}, select(c * d * d <= k - s, within, beyond), beyond);
  return select(c == V{}, s * d + z * v, select(s >= k, k * d + z * v, cubic));
}

// A repulsive triangle: slope 0.9 K up to |d| = s/10, then falling with K/10 to 0 at |d| = s:
//   |d| < s/10:        f = -(K - K/10) d + Z v
//   s/10 <= |d| < s:   f = -sgn(d) (s/10) K + (K/10) d + Z v
//   else:              f = 0
template <class V>
struct PluckShape {
  PluckShape(V k, V s) : rise(k - k / 10), fall(k / 10), inner(s / 10), outer(s), top(s / 10 * k) {}
  explicit PluckShape(const V* kept)  // as a row of its numbers
      : rise(kept[0]), fall(kept[1]), inner(kept[2]), outer(kept[3]), top(kept[4]) {}
  void keep(V* row) const {
    row[0] = rise;
    row[1] = fall;
    row[2] = inner;
    row[3] = outer;
    row[4] = top;
  }
  V rise;
  V fall;
  V inner;
  V outer;
  V top;  // where the outer slopes would meet at 0
};
template <class V>
static inline V pluck_force(V d, V v, const PluckShape<V>& shape, V z) {
  const V far = absolute(d);
  const V within = -shape.rise * d;
  const V beyond = shape.fall * d - select(d < V{}, -shape.top, shape.top);
  return select(far < shape.outer, select(far < shape.inner, within, beyond) + z * v, V{});
}
template <class V>
static inline V pluck_force(V d, V v, V k, V s, V z) {
  return pluck_force(d, v, PluckShape<V>(k, s), z);
}

// Friction that rises to 2/9 Z s at |v| = s/3 and falls to 0 at s:
//   |v| < s/3:        f = (Z - Z/3) v
//   s/3 <= |v| < s:   f = sgn(v) (s/3) Z - (Z/3) v
//   else:             f = 0
template <class V>
struct BowShape {
  BowShape(V z, V s) : stick(z - z / 3), slip(z / 3), inner(s / 3), outer(s), top(s / 3 * z) {}
  explicit BowShape(const V* kept)  // as a row of its numbers
      : stick(kept[0]), slip(kept[1]), inner(kept[2]), outer(kept[3]), top(kept[4]) {}
  void keep(V* row) const {
    row[0] = stick;
    row[1] = slip;
    row[2] = inner;
    row[3] = outer;
    row[4] = top;
  }
  V stick;
  V slip;
  V inner;
  V outer;
  V top;  // where the outer slopes would meet at 0
};
template <class V>
static inline V bow_force(V v, const BowShape<V>& shape) {
  const V fast = absolute(v);
  const V within = shape.stick * v;
  const V beyond = select(v < V{}, -shape.top, shape.top) - shape.slip * v;
  return select(fast < shape.outer, select(fast < shape.inner, within, beyond), V{});
}
template <class V>
static inline V bow_force(V v, V z, V s) {
  return bow_force(v, BowShape<V>(z, s));
}

// The same in one smooth curve: f = 0.63 Z v exp(-4 (v/s)^2 + 1/2)
template <class V>
static inline V smooth_bow_force(V v, V z, V s) {
  const V ratio = v / s;
  using T = Scalar<V>;
  return z * v * T(0.63) * exponential(V{} - 4 * ratio * ratio + T(0.5));
}

// Smooth while the profile is above 0.
template <class V>
static inline V either_bow_force(V v, V z, V s, V profile) {
  return select(profile > V{}, smooth_bow_force(v, z, s), bow_force(v, z, s));
}

// a is the lower body, b the upper, t the distance at which they touch:
//   d > -t: f = K (d + t) + Z v, else 0. It may pull on the way out, as published.
template <class V>
static inline V contact_force(V d, V v, V k, V z, V t) {
  return select(d > -t, k * (d + t) + z * v, V{});
}

// The same with a cubic spring that is clipped at k; without the clipped spring's extra damping.
// With D = d + t, and s instead of k where k < s:
//   d > -t: f = s D + c D^3 + Z v up to |D| = sqrt((k - s)/c), then k D + Z v; else 0
template <class V>
static inline V clipped_contact_force(V d, V v, V s, V c, V k, V z, V t) {
  const V depth = d + t;
  const V cubic = s * depth + c * depth * depth * depth;
  const V clipped = k * depth;
  const V bent = select(c > V{}, select(c * depth * depth <= k - s, cubic, clipped), clipped);
  const V elastic = select(k < s, s * depth, select(c == V{}, s * depth, bent));
  return select(d > -t, elastic + z * v, V{});
}

// Calls `use` with the law as a function of (d, v); the coefficients in the order of each law's
// arguments after them. The choice is made here, outside of every loop.
template <class V, class Use>
static inline void with_law(Law law, V c0, V c1, V c2, V c3, V c4, Use&& use) {
  switch (law) {
    case Law::spring:
      return use([=](V d, V v) { return spring_force(d, v, c0, c1); });
    case Law::quadratic_spring:
      return use([=](V d, V v) { return quadratic_spring_force(d, v, c0, c1, c2); });
    case Law::cubic_spring:
      return use([=](V d, V v) { return cubic_spring_force(d, v, c0, c1, c2); });
    case Law::clipped_spring:
      return use([=](V d, V v) { return clipped_spring_force(d, v, c0, c1, c2, c3); });
    case Law::pluck:
      return use([=](V d, V v) { return pluck_force(d, v, c0, c1, c2); });
    case Law::bow:
      return use([=](V, V v) { return bow_force(v, c0, c1); });
    case Law::smooth_bow:
      return use([=](V, V v) { return smooth_bow_force(v, c0, c1); });
    case Law::either_bow:
      return use([=](V, V v) { return either_bow_force(v, c0, c1, c2); });
    case Law::contact:
      return use([=](V d, V v) { return contact_force(d, v, c0, c1, c2); });
    case Law::clipped_contact:
      return use([=](V d, V v) { return clipped_contact_force(d, v, c0, c1, c2, c3, c4); });
  }
}

}  // namespace ressort
