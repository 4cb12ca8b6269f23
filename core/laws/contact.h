// core/laws: a is the lower body, b the upper, t the distance at which they touch:
//   d > -t: f = K (d + t) + Z v, else 0. It may pull on the way out, as published.
#pragma once

#include <algorithm>
#include <limits>

#include "core/laws/discrete_gradient.h"
#include "core/laws/straight.h"

namespace ressort::laws {
inline namespace RESSORT_ISA {
inline namespace RESSORT_ROUNDING {

template <class V>
struct Contact {
  static constexpr LawFacts facts = {
      .name = "contact",
      .family = Family::contact,
      .one = "contact",
      .many = "contacts",
      .count = 3,
      .arguments = {{{Role::stiffness, Unit::stiffness},
                     {Role::damping, Unit::damping},
                     {Role::reach, Unit::plain}}},
      .words = {{{.word = "contact",
                  .least = 2,
                  .most = 3,
                  .arguments = "@A @B K Z [THRESHOLD]",
                  .printed = 3,
                  .velocity_count = 2,
                  .velocity_says = "gives a contact no threshold"},
                 {.word = "detent",
                  .least = 2,
                  .most = 3,
                  .arguments = "@A @B K Z [THRESHOLD]",
                  .velocity_count = 2,
                  .velocity_says = "gives a contact no threshold"}}},
      .zone = Zone::below,
      .is_odd = false,
      .is_curved = false,
      .is_straight = true,
      .solve_ns = 35.0,
      .faust = "contact(k, z, t, d, v) = select2(d > 0.0 - t, 0.0, spring(k, z, d + t, v));\n",
  };

  V force(V d, V v) const { return select(d > -t, k * (d + t) + z * v, V{}); }
  V potential(V d) const {
    const V depth = d + t;
    return select(depth > V{}, Scalar<V>(0.5) * k * depth * depth, V{});
  }
  V secant(V) const { return k; }

  StraightPiece<V> piece(V) const requires std::is_floating_point_v<V> {
    return {-t, std::numeric_limits<V>::infinity(), k, z, k * t};
  }

  // P = K/2 max(0, d + t)^2, with a damper as far as it touches. With u = before + t, s = after -
  // before, a = free - before, h = gamma K/2 and m = 1 + gamma Z/2 every case is at most a
  // quadratic, solved without any cancellation:
  //   in and in:   (m + h) s = a - 2 h u
  //   leaving:     m s^2 - a s - h u^2 = 0, s < 0
  //   entering:    (m + h) p^2 - (a + 2 m u) p + u (a + m u) = 0, p = u + s > 0
  V passive(const LinkState<V>& link) const {
    if (!may_touch(link, t)) {
      return V{};
    }
    const V u = link.before() + t;
    const V a = link.free - link.before();
    const V damper = steady(link).damping;
    const V h = link.gamma * k / 2;
    const V m = 1 + link.gamma * damper;
    const V in = (a - 2 * h * u) / (m + h);
    const V bounce = square_root(a * a + 4 * m * h * u * u);
    const V out = select(a > V{}, -2 * h * u * u / (a + bounce), (a - bounce) / (2 * m));
    const V past = link.free + t + link.gamma * damper * u;
    const V b = a + 2 * m * u;
    const V hit = square_root(b * b - 4 * (m + h) * u * past);
    const V p = select(b < V{}, -2 * u * past / (hit - b), (b + hit) / (2 * (m + h)));

    const auto was_in = u > V{};
    const auto stays = was_in & (u + in >= V{});
    const auto enters = past > V{};
    const V step = select(was_in, select(stays, in, out), select(enters, p - u, a / m));
    // What is too small to be squared goes no way at all.
    const auto over = [](V square, V way) {
      return square / (2 * select(way == V{}, V{} + 1, way));
    };
    const V elastic = select(was_in, select(stays, k * (u + in / 2), over(-k * u * u, out)),
                             select(enters, over(k * p * p, p - u), V{}));
    return elastic + damper * step;
  }
  Steady<V> steady(const LinkState<V>& link) const {
    return {V{}, may_touch(link, t) ? z / 2 * share_inside(link, t) : V{}};
  }
  // With what is inside after and before, p and b, and their shares of the way, x and y, that is
  // K/2 (p + b)(x - y); both inside, x - y = 1.
  Slope<V> gradient(V before, V step) const {
    const V u = before + t;
    const V p = select(u + step > V{}, u + step, V{});
    const V b = select(u > V{}, u, V{});
    const auto is_in = (p > V{}) & (b > V{});
    const V wide = select(is_in | (step == V{}), V{} + 1, step);
    const V x = p / wide;
    const V y = b / wide;
    const V one = V{} + 1;
    return {k / 2 * (p + b) * select(is_in, one, x - y),
            k / 2 * select(is_in, one, 2 * x - x * x + y * y)};
  }

  // The same as long as it stays inside, and what it adds for every unit of the way.
  Slope<V> inside(V before) const { return {k * (before + t), (k + z) / 2}; }

  static Slopes steepest(const Contact&, const Contact& most, double) {
    return {.stiffness = most.k, .damping = most.z, .pull = most.k};
  }
  static Slopes gentlest(const Contact& least) {
    return {.damping = std::min(0.0, least.z), .pull = std::min(0.0, least.k)};
  }

  V k;
  V z;
  V t;
};

}  // namespace RESSORT_ROUNDING
}  // namespace RESSORT_ISA
}  // namespace ressort::laws
