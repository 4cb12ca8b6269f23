// core/engine: the laws of laws.h, so that none of them can gain energy. Each finds its force from
// where the link was, where it is and where it would be without it, and depends on nothing else:
//
//   f such that after = free - gamma f,  gamma = w_a + w_b, the inverse masses of what moves
//
// A potential P gives f = (P(after) - P(before))/(after - before), its discrete gradient: then
// 1/2 v^2/gamma + (P(now) + P(after))/2 is kept from sample to sample, whatever the stiffness
// (Gonzalez 1996; Chatziioannou and van Walstijn, J. Sound Vib. 339, 2015; Bilbao, Torin and
// Chatziioannou, Acta Acustica 101, 2015). Dampers and friction act on (after - before)/2.
// The K and the Z of quadratic and cubic springs remain as published: what is always felt is the
// matter of the stability proof, and the pitch of small vibrations stays what it was.
#pragma once

#include "core/kernels/laws.h"

namespace ressort {

// A link in one sample: distances x_a - x_b, and how they change per sample.
template <class V>
struct Meeting {
  V now;    // at the sample's beginning
  V speed;  // ...and how fast it was: a sample earlier it was at now - speed
  V free;   // at its end, as it would be without this link
  V fast;   // ...and how fast; not from positions, which may be far away
  V gamma;  // how far it gives way, by its two ends, to a force of 1

  V before() const { return now - speed; }
};

// What a link did in one sample: the impulse, and how far it has moved its ends by then, both for
// masses of 1. Where the force acts all at once, at the sample's beginning, these are the same.
template <class V>
struct Push {
  V x;
  V v;
};

// A value and its derivative.
template <class V>
struct Slope {
  V value;
  V slope;
};

// Four roundings.
template <class V>
static constexpr Scalar<V> tiny_share() {
  return sizeof(Scalar<V>) == 4 ? Scalar<V>(0x1p-22) : Scalar<V>(0x1p-51);
}

inline constexpr int most_newton_steps = 48;
inline constexpr int least_substeps = 16;
inline constexpr int most_substeps = 32;

// The f = g(after) that solves after + gamma g(after) = free between `far` and `free`: Newton, and
// by halves where that would leap too far or g falls too steeply. Lanes that have arrived stay, so
// that no lane depends on another.
template <class V, class Force>
static inline V force_between(V far, V start, V free, V gamma, Force&& g) {
  constexpr Scalar<V> tiny = tiny_share<V>();
  const V one = V{} + 1;
  V low = select(far < free, far, free);
  V high = select(far < free, free, far);
  V after = select(start < low, low, select(start > high, high, start));
  auto live = after == after;
  for (int i = 0; i < most_newton_steps && any_of(live); ++i) {
    const Slope<V> here = g(after);
    const V over = after - free + gamma * here.value;
    low = select(over < V{}, after, low);
    high = select(over < V{}, high, after);
    const V steep = one + gamma * here.slope;
    const V leap = after - over / steep;
    const V next = select((leap >= low) & (leap <= high) & (steep > V{}), leap, (low + high) / 2);
    const auto goes_on = absolute(next - after) > tiny * (absolute(after) + absolute(free));
    after = select(live, next, after);
    live = live & goes_on;
  }
  const Slope<V> here = g(after);
  const V over = after - free + gamma * here.value;
  return here.value - here.slope * over / (one + gamma * here.slope);
}

// The same for a g that rises: it is nowhere between more than at `free`.
template <class V, class Force>
static inline V rising_force(V free, V gamma, Force&& g) {
  return force_between(free - gamma * g(free).value, free, free, gamma, g);
}

// (P(after) - P(before))/(after - before), and its slope; near before, where the difference would
// be noise, the force in the middle.
template <class V, class Potential>
static inline Slope<V> discrete_gradient(const Potential& potential, V before, V after) {
  using T = Scalar<V>;
  constexpr T near = sizeof(T) == 4 ? T(4e-3) : T(4e-6);
  const V step = after - before;
  const V middle = (before + after) / 2;
  const auto is_near = absolute(step) <= near * (absolute(before) + absolute(after));
  const V wide = select(is_near, V{} + 1, step);
  const V quotient = (potential.energy(after) - potential.energy(before)) / wide;
  return {select(is_near, potential.force(middle), quotient),
          select(is_near, potential.slope(middle) / 2, (potential.force(after) - quotient) / wide)};
}

// f = K (after + before)/2 + Z (after - before)/2
template <class V>
static inline V centred_spring_force(const Meeting<V>& m, V k, V z) {
  const V later = (k + z) / 2;
  return (later * m.free + (k - z) / 2 * m.before()) / (1 + m.gamma * later);
}

// f = K now + Z (now - before) + Q now^2 (after + before)/2: linearly implicit, with the energy
// Q/4 now^2 after^2.
template <class V>
static inline V centred_cubic_spring_force(const Meeting<V>& m, V k, V q, V z) {
  const V bent = q * m.now * m.now / 2;
  const V linear = spring_force(m.now, m.speed, k, z);
  return (linear + bent * (m.free + m.before())) / (1 + m.gamma * bent);
}

// f = K now + Z (now - before) + the discrete gradient of Q/3 |d|^3, which without any cancellation
// is sgn(after) Q/3 (a^2 + a b + b^2), a and b being |after| and |before|; times (a - b)/(a + b)
// where the signs differ.
template <class V>
static inline V centred_quadratic_spring_force(const Meeting<V>& m, V k, V q, V z) {
  const V linear = spring_force(m.now, m.speed, k, z);
  const V b = absolute(m.before());
  const auto g = [&](V after) {
    const V a = absolute(after);
    const V square = q / 3 * (a * a + a * b + b * b);
    const auto crosses = after * m.before() < V{};
    const V side = select(select(crosses, after, after + m.before()) < V{}, V{} - 1, V{} + 1);
    const V across = select(crosses, (a - b) / (a + b), V{} + 1);
    const V f = square * across;
    const V steep = select(crosses, (q * a * a - f) / (a + b), q / 3 * (a + a + b));
    return Slope<V>{linear + side * f, steep};
  };
  return rising_force(m.free, m.gamma, g);
}

// s d^2/2 + c d^4/4 up to b = sqrt((k - s)/c), where the force is that of k, then k d^2/2 and as
// much less as both differ there, (k - s)^2/4c. A plain spring is one with c = 0 and k = s.
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

// The same on one side of 0 only.
template <class V>
struct ClippedWall {
  V energy(V d) const { return select(d > V{}, inside.energy(d), V{}); }
  V force(V d) const { return select(d > V{}, inside.force(d), V{}); }
  V slope(V d) const { return select(d > V{}, inside.slope(d), V{}); }
  ClippedPotential<V> inside;
};

// g of a potential and a damper.
template <class V, class Potential>
static inline V damped_force(const Potential& potential, V before, V free, V gamma, V damping) {
  return rising_force(free, gamma, [&](V after) {
    const Slope<V> elastic = discrete_gradient(potential, before, after);
    return Slope<V>{elastic.value + damping / 2 * (after - before), elastic.slope + damping / 2};
  });
}

// The clipped spring's potential and damper; the latter is that of now.
template <class V>
static inline V centred_clipped_spring_force(const Meeting<V>& m, V s, V c, V k, V z) {
  const auto is_bent = (c > V{}) & (s < k);
  const V straight = select(c == V{}, s, k);
  const ClippedPotential<V> potential(select(is_bent, s, straight), select(is_bent, c, V{}),
                                      select(is_bent, k, straight));
  const V beyond = z + Scalar<V>(0.3) * k;
  const V bent = select(c * m.now * m.now <= k - s, z, beyond);
  const V damping = select(c == V{}, z, select(s >= k, z, select(c > V{}, bent, beyond)));
  return damped_force(potential, m.before(), m.free, m.gamma, damping);
}

// How much of the way from one depth to another is inside.
template <class V>
static inline V share_inside(V from, V to) {
  const V inside = select(to > V{}, to, V{}) - select(from > V{}, from, V{});
  const auto moves = to != from;
  const V still = select(from > V{}, V{} + 1, V{});
  return select(moves, inside / select(moves, to - from, V{} + 1), still);
}

// Of the two samples that a centred damper acts over. As it sets in and ends at full speed, it
// makes a difference whether it does so between two samples or with one.
template <class V>
static inline V share_inside(const Meeting<V>& m, V t) {
  const V depth = m.now + t;
  return (share_inside(m.before() + t, depth) + share_inside(depth, m.free + t)) / 2;
}

// Whether it may touch in any lane; where not, it exerts nothing.
template <class V>
static inline bool may_touch(const Meeting<V>& m, V t) {
  return any_of((m.before() > -t) | (m.now > -t) | (m.free > -t));
}

// P = K/2 max(0, d + t)^2, with a damper as far as it touches. With u = before + t, s = after -
// before, a = free - before, h = gamma K/2 and m = 1 + gamma Z/2 every case is at most a quadratic,
// solved without any cancellation:
//   in and in:   (m + h) s = a - 2 h u
//   leaving:     m s^2 - a s - h u^2 = 0, s < 0
//   entering:    (m + h) p^2 - (a + 2 m u) p + u (a + m u) = 0, p = u + s > 0
template <class V>
static inline V centred_contact_force(const Meeting<V>& meeting, V k, V z, V t) {
  if (!may_touch(meeting, t)) {
    return V{};
  }
  const V u = meeting.before() + t;
  const V a = meeting.free - meeting.before();
  const V damper = z / 2 * share_inside(meeting, t);
  const V h = meeting.gamma * k / 2;
  const V m = 1 + meeting.gamma * damper;
  const V in = (a - 2 * h * u) / (m + h);
  const V bounce = square_root(a * a + 4 * m * h * u * u);
  const V out = select(a > V{}, -2 * h * u * u / (a + bounce), (a - bounce) / (2 * m));
  const V past = meeting.free + t + meeting.gamma * damper * u;
  const V b = a + 2 * m * u;
  const V hit = square_root(b * b - 4 * (m + h) * u * past);
  const V p = select(b < V{}, -2 * u * past / (hit - b), (b + hit) / (2 * (m + h)));

  const auto was_in = u > V{};
  const auto stays = was_in & (u + in >= V{});
  const auto enters = past > V{};
  const V step = select(was_in, select(stays, in, out), select(enters, p - u, a / m));
  const V elastic = select(was_in, select(stays, k * (u + in / 2), -k * u * u / (2 * out)),
                           select(enters, k * p * p / (2 * (p - u)), V{}));
  return elastic + damper * step;
}

// P of the clipped contact, with a damper as far as it touches.
template <class V>
static inline V centred_clipped_contact_force(const Meeting<V>& m, V s, V c, V k, V z, V t) {
  if (!may_touch(m, t)) {
    return V{};
  }
  const auto is_bent = (c > V{}) & (k >= s);
  const V straight = select((k < s) | (c == V{}), s, k);
  const ClippedWall<V> wall{
      {select(is_bent, s, straight), select(is_bent, c, V{}), select(is_bent, k, straight)}};
  const V damping = z * share_inside(m, t);
  return damped_force(wall, m.before() + t, m.free + t, m.gamma, damping);
}

// Friction f(v) at the speed v that solves v + half f(v) = wanted, in closed form. For half Z > 3
// there may be three such speeds: it goes on to stick, or to slip, as it did at the speed `last`.
template <class V>
static inline V gripping_force(const BowShape<V>& bow, V wanted, V last, V half) {
  const V side = select(wanted < V{}, V{} - 1, V{} + 1);
  const V fast = side * wanted;
  const V stuck = fast / (1 + half * bow.stick);
  const V give = 1 - half * bow.slip;
  const V slipping = (fast - half * bow.top) / give;
  const V torn = bow.inner * (1 + half * bow.stick);  // where sticking ends
  const auto sticks = fast < torn;
  const auto is_free = fast >= bow.outer;
  const auto remains = sticks & ((fast < bow.outer) | (side * last < slipping));
  const V steep = select(remains, bow.stick * stuck, V{});
  const V gentle =
      select(sticks, bow.stick * stuck, select(is_free, V{}, bow.top - bow.slip * slipping));
  return side * select(give > V{}, gentle, steep);
}

// The same for the smooth one, from the speed `last` on.
template <class V>
static inline V gripping_force(V z, V s, V wanted, V last, V half) {
  const auto g = [&](V v) {
    const V ratio = v / s;
    using T = Scalar<V>;
    const V grip = T(0.63) * z * exponential(T(0.5) - 4 * ratio * ratio);
    return Slope<V>{grip * v, grip * (1 - 8 * ratio * ratio)};
  };
  return force_between(V{}, last, wanted, half, g);
}

// What any bow exerts at that speed, by its law.
template <class V>
static inline V bow_grip(Law law, V z, V s, V profile, V wanted, V last, V half) {
  if (law == Law::smooth_bow) {
    return gripping_force(z, s, wanted, last, half);
  }
  const V piecewise = gripping_force(BowShape<V>(z, s), wanted, last, half);
  return law == Law::bow
             ? piecewise
             : select(profile > V{}, gripping_force(z, s, wanted, last, half), piecewise);
}

// Goes through the sample in `count` steps of 1/count: half a way, a kick, half a way. Without the
// link it would go from now on evenly accelerated, so that `speed` and `fast` are those of the
// middles of the sample before and of this one. `kick` gives the force for the distance,
// the speed before it, what is added to that anyway, and gamma/count.
template <class V, class Kick>
static inline Push<V> substep(const Meeting<V>& m, int count, Kick&& kick) {
  const auto dt = 1 / static_cast<Scalar<V>>(count);
  const V more = (m.fast - m.speed) * dt;
  V speed = (m.speed + m.fast) / 2;
  V d = m.now;
  Push<V> push{V{}, V{}};
  for (int i = 0; i < count; ++i) {
    d += speed * (dt / 2);
    const V f = kick(d, speed, more, m.gamma * dt);
    speed += more - m.gamma * dt * f;
    d += speed * (dt / 2);
    push.v += f * dt;
    push.x += f * dt * (1 - (static_cast<Scalar<V>>(i) + Scalar<V>(0.5)) * dt);
  }
  return push;
}

// A pluck's force falls as steeply as it wants to snap, and a finger may pass in a sample.
template <class V>
static inline Push<V> substepped_pluck(const Meeting<V>& m, int count, V k, V s, V z) {
  const V curve = absolute(m.fast - m.speed);
  const V now = absolute(m.now);
  const V free = absolute(m.free);
  const auto may_touch = (select(now < free, now, free) < s + curve) | (m.now * m.free < V{});
  if (!any_of(may_touch)) {
    return {V{}, V{}};
  }
  const PluckShape<V> shape(k, s);
  return substep(m, count, [&](V d, V v, V, V) { return pluck_force(d, v, shape, z); });
}

template <class V>
static inline V centred_force(Law law, const Meeting<V>& m, V c0, V c1, V c2, V c3, V c4) {
  const V wanted = (m.speed + m.fast) / 2;
  switch (law) {
    case Law::spring:
      return centred_spring_force(m, c0, c1);
    case Law::quadratic_spring:
      return centred_quadratic_spring_force(m, c0, c1, c2);
    case Law::cubic_spring:
      return centred_cubic_spring_force(m, c0, c1, c2);
    case Law::clipped_spring:
      return centred_clipped_spring_force(m, c0, c1, c2, c3);
    case Law::bow:
    case Law::smooth_bow:
    case Law::either_bow:
      return bow_grip(law, c0, c1, c2, wanted, m.speed, m.gamma / 2);
    case Law::contact:
      return centred_contact_force(m, c0, c1, c2);
    case Law::clipped_contact:
      return centred_clipped_contact_force(m, c0, c1, c2, c3, c4);
    case Law::pluck:
      break;  // has no centred form: its potential is a hill
  }
  return V{};
}

// What a link does in a sample, by its scheme, which is not the plain one. Plucks are taken in
// substeps, bows if they are asked to be, anything else centred.
template <class V>
static inline Push<V> passive_push(Law law, Scheme scheme, int substeps, const Meeting<V>& m, V c0,
                                   V c1, V c2, V c3, V c4) {
  if (law == Law::pluck) {
    return substepped_pluck(m, substeps, c0, c1, c2);
  }
  const bool is_bow = law == Law::bow || law == Law::smooth_bow || law == Law::either_bow;
  if (scheme == Scheme::substeps && is_bow) {
    return substep(m, substeps, [&](V, V v, V more, V gamma) {
      return bow_grip(law, c0, c1, c2, v + more / 2, v, gamma / 2);
    });
  }
  const V f = centred_force(law, m, c0, c1, c2, c3, c4);
  return {f, f};
}

}  // namespace ressort
