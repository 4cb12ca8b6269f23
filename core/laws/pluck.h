// core/laws: a repulsive triangle: slope 0.9 K up to |d| = s/10, then falling with K/10 to 0 at
// |d| = s:
//   |d| < s/10:        f = -(K - K/10) d + Z v
//   s/10 <= |d| < s:   f = -sgn(d) (s/10) K + (K/10) d + Z v
//   else:              f = 0
#pragma once

#include <algorithm>

#include "core/laws/discrete_gradient.h"
#include "core/laws/straight.h"

namespace ressort::laws {
inline namespace RESSORT_ISA {
inline namespace RESSORT_ROUNDING {

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
      .is_convex = false,
      .solve_ns = 100.0,
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

  StraightPiece<V> piece(V d) const requires std::is_floating_point_v<V> {
    if (absolute(d) < inner) {
      return {-inner, inner, -rise, z, V{}};
    }
    return d < V{} ? StraightPiece<V>{-outer, -inner, fall, z, top}
                   : StraightPiece<V>{inner, outer, fall, z, -top};
  }

  // Where it wants to snap, or where what is fast passes it in a sample, several ways s keep the
  // energy, m s^2 - free s + gamma (P(before + s) - P(before)) = 0 with m = 1 + gamma Z/2: it goes
  // the first of them, as a motion would come there that goes on without leaps. The hill being made
  // of five pieces that are at most squares, that is the first root of five quadratic equations
  // that lies on its own piece. What is in balance goes nowhere: a string at rest under a finger
  // that rests on it, on the very top of the hill, stays there however steep that is.
  V passive(const LinkState<V>& link) const {
    const V before = link.before();
    const V ahead = link.free - before;
    const V reach = outer + absolute(ahead) + absolute(link.now - before);
    if (!any_of(absolute(link.now) < reach)) {
      return V{};
    }
    const V one = V{} + 1;
    const V damping = steady(link).damping;
    const V m = one + link.gamma * damping;
    const V balance = force(before, V{});
    const auto stays = ahead == link.gamma * balance;
    const V side = select(ahead < link.gamma * balance, -one, one);
    const V b = side * before;
    const V free = side * ahead;
    const V height = potential(b);
    const V summit = potential(V{});
    V s = free / m;
    const auto no = V{} != V{};
    auto is_found = b > outer;  // it never comes there
    const auto try_piece = [&](V from, V to, V level, V bend, V middle) {
      const V there = b - middle;
      const V square = m + link.gamma * bend / 2;
      const V linear = link.gamma * bend * there - free;
      const V rest = link.gamma * (level + bend / 2 * there * there - height);
      const V inside = linear * linear - 4 * square * select((b >= from) & (b < to), V{}, rest);
      const V root = square_root(select(inside > V{}, inside, V{}));
      const auto falls = linear < V{};
      const V bottom = select(falls, 2 * square, linear + root);
      const V way = select(falls, root - linear, -2 * rest) / select(bottom == V{}, one, bottom);
      const V slack = 8 * tiny_share<V>() * (outer + absolute(b) + way);
      const auto is_here = (inside >= V{}) & (bottom != V{}) & (way >= V{}) & (b < to) &
                           (b + way <= to + slack) & (b + way >= from - slack);
      s = select(is_here & (is_found == no), way, s);
      is_found = is_found | is_here;
    };
    const V endless = V{} + Scalar<V>(1e30);
    try_piece(-endless, -outer, V{}, V{}, V{});
    try_piece(-outer, -inner, V{}, fall, -outer);
    try_piece(-inner, inner, summit, -rise, V{});
    try_piece(inner, outer, V{}, fall, outer);
    try_piece(outer, endless, V{}, V{}, V{});
    s *= side;
    Slope<V> here = gradient(before, s);
    const V steep = m + link.gamma * here.slope;
    const V over = m * s - ahead + link.gamma * here.value;
    const V more =
        select(absolute(steep) > Scalar<V>(1e-3), over / select(steep == V{}, one, steep), V{});
    return select(stays, balance, here.value + damping * s - (here.slope + damping) * more);
  }
  Steady<V> steady(const LinkState<V>& link) const {
    const V touches = select(absolute(link.now) < outer, V{} + 1, V{});
    return {V{}, z / 2 * touches};
  }
  // Its force is made of four ramps, as is that at the mirror's other side: f(d) = fall (r(d +
  // outer)
  // - r(d - outer)) - K (r(d + inner) - r(d - inner)), r(x) being max(0, x). So is its discrete
  // gradient, and what is between two corners is exact, however short the step.
  Slope<V> gradient(V before, V step) const {
    const V side = select(before + step / 2 > V{}, V{} - 1, V{} + 1);
    const V b = side * before;
    const V s = side * step;
    const Slope<V> foot = ramp(b + outer, s);
    const Slope<V> other_foot = ramp(b - outer, s);
    const Slope<V> top = ramp(b + inner, s);
    const Slope<V> other_top = ramp(b - inner, s);
    const V k = rise + fall;
    return {side * (fall * (foot.value - other_foot.value) - k * (top.value - other_top.value)),
            fall * (foot.slope - other_foot.slope) - k * (top.slope - other_top.slope)};
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

 private:
  // The discrete gradient of max(0, x)^2/2, from x on.
  static Slope<V> ramp(V x, V step) {
    const V before = select(x > V{}, x, V{});
    const V after = select(x + step > V{}, x + step, V{});
    const auto is_up = (before > V{}) & (after > V{});
    const V share = (after - before) / select(step == V{}, V{} + 1, step);
    const V square = share * share / 2;
    return {(after + before) / 2 * select(is_up, V{} + 1, share),
            select(is_up, V{} + Scalar<V>(0.5), select(before > V{}, square, share - square))};
  }
};

}  // namespace RESSORT_ROUNDING
}  // namespace RESSORT_ISA
}  // namespace ressort::laws
