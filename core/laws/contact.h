// core/laws: a contact between the lower body a and the upper body b, which touch at distance t:
//   d > -t: f = K (d + t) + Z v, else 0
// The force may attract while the bodies separate, as published.
#pragma once

#include <algorithm>

#include "core/laws/discrete_gradient.h"

namespace ressort::laws {
inline namespace RESSORT_ISA {
inline namespace RESSORT_ROUNDING {

template <class V>
struct Contact {
  static constexpr LawFacts facts = {
      .name = "contact",
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
      .solve_operations = 140.0,
      .faust = R"(
contact(k, z, t, d, v) = select2(d > 0.0 - t, 0.0, spring(k, z, d + t, v));
steady_contact(k, z, t, now, speed, way) = 0.0,
  0.5*z*inside(now - speed + t, now + t, now - speed + way + t);
gradient_contact(k, z, t, b, s) = 0.5*k*(p + q)*select2(is_in, x - y, 1.0),
  0.5*k*select2(is_in, 2.0*x - x*x + y*y, 1.0)
with {
  p = max(0.0, b + t + s);
  q = max(0.0, b + t);
  is_in = min(p, q) > 0.0;
  wide = select2(is_in, select2(s == 0.0, s, 1.0), 1.0);
  x = p/wide;
  y = q/wide;
};
alone_contact(k, z, t, f, damping, b, speed, a, gamma) = elastic + damping*step
with {
  u = b + t;
  h = 0.5*gamma*k;
  m = 1.0 + gamma*damping;
  in = (a - 2.0*h*u)/(m + h);
  bounce = sqrt(a*a + 4.0*m*h*u*u);
  out = select2(a > 0.0, (a - bounce)/(2.0*m), (0.0 - 2.0)*h*u*u/(a + bounce));
  past = a + u*m;
  c = a + 2.0*m*u;
  hit = sqrt(max(0.0, c*c - 4.0*(m + h)*u*past));
  p = select2(c < 0.0, (c + hit)/(2.0*(m + h)), (0.0 - 2.0)*u*past/(hit - c));
  stays = (u > 0.0) & (u + in >= 0.0);
  step = select2(u > 0.0, select2(past > 0.0, a/m, p - u), select2(stays, out, in));
  over(square, way) = square/(2.0*select2(way == 0.0, way, 1.0));
  elastic = select2(u > 0.0, select2(past > 0.0, 0.0, over(k*p*p, p - u)),
    select2(stays, over((0.0 - k)*u*u, out), k*(u + 0.5*in)));
};
)",
  };

  V force(V d, V v) const { return select(d > -t, k * (d + t) + z * v, V{}); }
  V potential(V d) const {
    const V depth = d + t;
    return select(depth > V{}, Scalar<V>(0.5) * k * depth * depth, V{});
  }
  V secant(V) const { return k; }

  // The discrete gradient of P = K/2 max(0, d + t)^2, and a damper for the time of the touch. With
  // u = before + t, s = after - before, a = free - before, h = gamma K/2 and m = 1 + gamma Z/2,
  // each case is at most a quadratic equation. The formulas avoid cancellation:
  //   inside:      (m + h) s = a - 2 h u
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
    const auto was_in = u > V{};
    const auto stays = was_in & (u + in >= V{});
    if (!any_of(stays == 0)) {
      return k * (u + in / 2) + damper * in;
    }
    const V bounce = square_root(a * a + 4 * m * h * u * u);
    const V out = select(a > V{}, -2 * h * u * u / (a + bounce), (a - bounce) / (2 * m));
    const V past = link.free + t + link.gamma * damper * u;
    const V b = a + 2 * m * u;
    const V hit = square_root(b * b - 4 * (m + h) * u * past);
    const V p = select(b < V{}, -2 * u * past / (hit - b), (b + hit) / (2 * (m + h)));
    const auto enters = past > V{};
    const V step = select(was_in, select(stays, in, out), select(enters, p - u, a / m));
    // A step whose square underflows counts as no step.
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
  // K/2 (p + b)(x - y), with the depths p and b after and before the step, and their shares x and y
  // of the step. If both depths are positive, x - y = 1.
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

  // Returns the force while the bodies touch throughout, and its slope per unit of the step.
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
