// core/laws: a plectrum that repels the string. The force grows with slope 0.9 K up to |d| = s/10,
// then falls with slope K/10 to 0 at |d| = s:
//   |d| < s/10:        f = -(K - K/10) d + Z v
//   s/10 <= |d| < s:   f = -sgn(d) (s/10) K + (K/10) d + Z v
//   else:              f = 0
#pragma once

#include <algorithm>

#include "core/laws/discrete_gradient.h"

namespace ressort::laws {
inline namespace RESSORT_ISA {
inline namespace RESSORT_ROUNDING {

template <class V>
struct Pluck {
  static constexpr LawFacts facts = {
      .name = "pluck",
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
      .solve_operations = 400.0,
      .faust = R"(
pluck(k, s, z, d, v) =
  select2(abs(d) < s, 0.0, select2(abs(d) < s/10.0, outer, inner)*k + z*v)
with {
  inner = 0.0 - 0.9*d;
  outer = d/10.0 - s/10.0*select2(d < 0.0, 1.0, 0.0 - 1.0);
};
steady_pluck(k, s, z, now, speed, way) = 0.0, select2(abs(now) < s, 0.0, 0.5*z);
gradient_pluck(k, s, z, d, way) = foot, other_foot, top, other_top : added
with {
  side = select2(d + 0.5*way > 0.0, 1.0, 0.0 - 1.0);
  b = side*d;
  foot = ramp(b + s);
  other_foot = ramp(b - s);
  top = ramp(b + s/10.0);
  other_top = ramp(b - s/10.0);
  added(v1, s1, v2, s2, v3, s3, v4, s4) =
    side*k*(0.1*(v1 - v2) - (v3 - v4)), k*(0.1*(s1 - s2) - (s3 - s4));
  ramp(x) = 0.5*(after + before)*select2(is_up, share, 1.0),
    select2(is_up, select2(before > 0.0, square, share - square), 0.5)
  with {
    go = side*way;
    before = max(0.0, x);
    after = max(0.0, x + go);
    is_up = min(before, after) > 0.0;
    share = (after - before)/select2(go == 0.0, go, 1.0);
    square = 0.5*share*share;
  };
};
alone_pluck(k, s, z, f, damping, before, speed, way, gamma) =
  select2(way < gamma*force, 1.0, 0.0 - 1.0) : facing
with {
  inner = s/10.0;
  m = 1.0 + gamma*damping;
  force = select2(abs(before) < s, 0.0,
    select2(abs(before) < inner, outside, (0.0 - 0.9)*k*before));
  outside = k/10.0*(before - select2(before < 0.0, s, 0.0 - s));
  hill(d) = select2(abs(d) < s, 0.0,
    0.05*k*slope*slope + 0.45*k*max(0.0, inner*inner - d*d))
  with {
    slope = s - max(abs(d), inner);
  };
  facing(side) = side*before, side*way, hill(before) : climb : *(side) : found;
  climb(b, free, height) = free/m, select2(b > s, 0.0, 1.0) :
    piece(0.0 - 1e30, 0.0 - s, 0.0, 0.0, 0.0) :
    piece(0.0 - s, 0.0 - inner, 0.0, 0.1*k, 0.0 - s) :
    piece(0.0 - inner, inner, hill(0.0), 0.0 - 0.9*k, 0.0) :
    piece(inner, s, 0.0, 0.1*k, s) : piece(s, 1e30, 0.0, 0.0, 0.0) : _, !
  with {
    piece(from, to, level, bend, middle, old, has) =
      m + 0.5*gamma*bend, gamma*bend*there - free,
      gamma*(level + 0.5*bend*there*there - height) : solve
    with {
      there = b - middle;
      solve(square, linear, rest) = square, linear, rest,
        linear*linear - 4.0*square*select2((b >= from) & (b < to), rest, 0.0) : root;
      root(square, linear, rest, inside) =
        square, linear, rest, inside, sqrt(max(0.0, inside)) : first;
      first(square, linear, rest, inside, root) = inside,
        select2(linear < 0.0, linear + root, 2.0*square),
        select2(linear < 0.0, 0.0 - 2.0*rest, root - linear) : divided;
      divided(inside, bottom, top) =
        inside, bottom, top/select2(bottom == 0.0, bottom, 1.0) : judged;
      judged(inside, bottom, go) = go,
        ((inside >= 0.0) & (bottom != 0.0) & (go >= 0.0) & (b < to) &
        (b + go <= to + slack) & (b + go >= from - slack)) : chosen
      with {
        slack = 3.6e-15*(s + abs(b) + go);
      };
      chosen(go, is_here) =
        select2(is_here & (has < 0.5), old, go), select2(is_here, has, 1.0);
    };
  };
  found(step) = gradient_pluck(k, s, z, before, step) : pulls
  with {
    pulls(value, bend) = select2(way == gamma*force, pull, force)
    with {
      pull = value + damping*step - (bend + damping)*more;
      steep = m + gamma*bend;
      over = m*step - way + gamma*value;
      more = select2(abs(steep) > 0.001, 0.0, over/steep);
    };
  };
};
)",
  };

  Pluck(V k, V s, V z_in)
      : rise(k - k / 10), fall(k / 10), inner(s / 10), outer(s), top(s / 10 * k), z(z_in) {}

  // Reads the row that `keep` writes (see LawType in laws.h).
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

  // When the string snaps, or passes the plectrum within a sample, several steps s conserve energy:
  // m s^2 - free s + gamma (P(before + s) - P(before)) = 0 with m = 1 + gamma Z/2. The string takes
  // the shortest of them, which a continuous motion reaches first. The potential P consists of five
  // pieces, each at most quadratic, so this is the first root of five quadratic equations that lies
  // on its own piece. In equilibrium the step is 0: a string at rest at the top of the potential
  // stays there, however steep the slopes are.
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
    auto is_found = b > outer;  // the string moves away
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
  // Let r(x) = max(0, x). The force is a sum of four ramps: f(d) = fall (r(d + outer) -
  // r(d - outer)) - K (r(d + inner) - r(d - inner)). Its discrete gradient is the same sum of the
  // ramps' gradients, which are exact for steps of any length. The step is mirrored to d < 0.
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

  // The slope dF/dd is positive beyond |d| = s/10, or below it for K < 0.
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
  V top;  // force of the extended outer slope at d = 0
  V z;

 private:
  // Returns the discrete gradient of max(0, x)^2/2 between x and x + step.
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
