// core/laws: laws that cannot gain energy, by discrete gradients. Each finds its force from where
// the link was, where it is and where it would be without it, and depends on nothing else:
//
//   f such that after = free - gamma f,  gamma = w_a + w_b, the inverse masses of what moves
//
// A potential P gives f = (P(after) - P(before))/(after - before), its discrete gradient: then
// 1/2 v^2/gamma + (P(now) + P(after))/2 is kept from sample to sample, whatever the stiffness
// (Gonzalez 1996; Chatziioannou and van Walstijn, J. Sound Vib. 339, 2015; Bilbao, Torin and
// Chatziioannou, Acta Acustica 101, 2015). Dampers and friction act on (after - before)/2.
//
// Laws and their tools are compiled for every instruction set in a namespace of its own,
// RESSORT_ISA (elsewhere a namespace of that very name): what is built for a wide machine is never
// linked into what runs on a narrow one. Within it is RESSORT_ROUNDING, in the same way: `exact`
// where a kernel is built without fused multiply-adds, and is not linked with laws that have them.
#pragma once

#include "core/lanes.h"
#include "core/laws/law.h"

namespace ressort::laws {
inline namespace RESSORT_ISA {
inline namespace RESSORT_ROUNDING {

// A link in one sample: distances x_a - x_b, and how they change per sample.
template <class V>
struct LinkState {
  V now;    // at the sample's beginning
  V speed;  // ...and how fast it was: a sample earlier it was at now - speed
  V free;   // at its end, as it would be without this link
  V fast;   // ...and how fast; not from positions, which may be far away
  V gamma;  // how far it gives way, by its two ends, to a force of 1

  V before() const { return now - speed; }
};

// A value and its derivative.
template <class V>
struct Slope {
  V value;
  V slope;
};

// What a link exerts wherever it will be, and what it adds for every unit that it goes in two
// samples: what does not depend on the solution.
template <class V>
struct Steady {
  V force;
  V damping;
};

// Four roundings.
template <class V>
static constexpr Scalar<V> tiny_share() {
  return sizeof(Scalar<V>) == 4 ? Scalar<V>(0x1p-22) : Scalar<V>(0x1p-51);
}

inline constexpr int most_newton_steps = 48;

// The f = g(after) that solves after + gamma g(after) = free between `far` and `free`: Newton, and
// by halves where that would step too far or g falls too steeply. Lanes that have arrived stay, so
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
    const V newton = after - over / steep;
    const V next =
        select((newton >= low) & (newton <= high) & (steep > V{}), newton, (low + high) / 2);
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

// (P(after) - P(before))/step, after being before + step, and its slope; near before, where the
// difference would be noise, the force in the middle; so too where squares vanish.
template <class V, class Potential>
static inline Slope<V> discrete_gradient(const Potential& potential, V before, V step) {
  using T = Scalar<V>;
  constexpr T near = sizeof(T) == 4 ? T(4e-3) : T(4e-6);
  constexpr T nothing = sizeof(T) == 4 ? T(1e-18) : T(1e-150);
  const V after = before + step;
  const V middle = before + step / 2;
  const V far = absolute(before) + absolute(after);
  const auto is_near = (absolute(step) <= near * far) | (far < nothing);
  const V wide = select(is_near, V{} + 1, step);
  const V quotient = (potential.energy(after) - potential.energy(before)) / wide;
  return {select(is_near, potential.force(middle), quotient),
          select(is_near, potential.slope(middle) / 2, (potential.force(after) - quotient) / wide)};
}

// g of a potential and a damper, which adds `damping` for every unit of the way.
template <class V, class Potential>
static inline V damped_force(const Potential& potential, V before, V free, V gamma, V damping) {
  return rising_force(free, gamma, [&](V after) {
    const Slope<V> elastic = discrete_gradient(potential, before, after - before);
    return Slope<V>{elastic.value + damping * (after - before), elastic.slope + damping};
  });
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
static inline V share_inside(const LinkState<V>& m, V t) {
  const V depth = m.now + t;
  return (share_inside(m.before() + t, depth) + share_inside(depth, m.free + t)) / 2;
}

// Whether it may touch in any lane; where not, it exerts nothing.
template <class V>
static inline bool may_touch(const LinkState<V>& m, V t) {
  return any_of((m.before() > -t) | (m.now > -t) | (m.free > -t));
}

// Of a bow or what is like it, by its `grip(wanted, last, half)`: the friction f(v) at the speed v
// that solves v + half f(v) = wanted, if it was at the speed `last`. Whichever of several speeds
// that is, friction only takes.
template <class V, class Friction>
static inline V rubbed(const Friction& bow, const LinkState<V>& link) {
  return bow.grip((link.speed + link.fast) / 2, link.speed, link.gamma / 2);
}

// The friction after so long a way in two samples, and how much more there is of it for every unit.
template <class V, class Friction>
static inline Slope<V> rubbing(const Friction& bow, V step) {
  const Slope<V> friction = bow.friction(step / 2);
  return {friction.value, friction.slope / 2};
}

}  // namespace RESSORT_ROUNDING
}  // namespace RESSORT_ISA
}  // namespace ressort::laws
