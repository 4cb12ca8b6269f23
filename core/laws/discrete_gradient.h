// core/laws: tools for the passive forms of laws, which cannot create energy. A passive force
// depends on the distance one sample ago (before), now, and at the next sample without the link
// (free):
//
//   after = free - gamma f,  gamma = w_a + w_b, the inverse masses of the moving ends
//
// The force of a potential P is its discrete gradient, f = (P(after) - P(before))/(after - before).
// Then 1/2 v^2/gamma + (P(now) + P(after))/2 is conserved from sample to sample at any stiffness
// (Gonzalez 1996; Chatziioannou and van Walstijn, J. Sound Vib. 339, 2015; Bilbao, Torin and
// Chatziioannou, Acta Acustica 101, 2015). Dampers and friction act on the mean velocity
// (after - before)/2.
//
// Laws and their tools are compiled once for each instruction set, in the inline namespace
// RESSORT_ISA, so that the linker never merges code for a wide processor into code for a narrow
// one. The inner namespace RESSORT_ROUNDING does the same for `exact` kernels, which are built
// without fused multiply-adds.
#pragma once

#include "core/lanes.h"
#include "core/laws/law.h"

namespace ressort::laws {
inline namespace RESSORT_ISA {
inline namespace RESSORT_ROUNDING {

// The state of a link in one sample: distances x_a - x_b and velocities per sample.
template <class V>
struct LinkState {
  V now;    // distance at the start of the sample
  V speed;  // velocity there: the distance one sample earlier is now - speed
  V free;   // distance at the end of the sample without this link
  V fast;   // velocity there; not computed from positions, which may be large
  V gamma;  // compliance: the change of distance by a force of 1 on both ends

  V before() const { return now - speed; }
};

// A value and its derivative.
template <class V>
struct Slope {
  V value;
  V slope;
};

// The same with the second derivative.
template <class V>
struct Curve : Slope<V> {
  V curvature;
};

// The part of a passive force that does not depend on the solution: a constant force, and a damping
// per unit of the change of distance in two samples.
template <class V>
struct Steady {
  V force;
  V damping;
};

// Relative size of four rounding errors.
template <class V>
static constexpr Scalar<V> tiny_share() {
  return sizeof(Scalar<V>) == 4 ? Scalar<V>(0x1p-22) : Scalar<V>(0x1p-51);
}

// After a shorter step, relative to the distances, the error of Newton's method is its square, and
// that of Chebyshev's its third power, which is less than rounding.
template <class V>
static constexpr Scalar<V> last_step(bool is_curved) {
  return sizeof(Scalar<V>) == 4 ? Scalar<V>(is_curved ? 0x1p-10 : 0x1p-14)
                                : Scalar<V>(is_curved ? 0x1p-24 : 0x1p-34);
}

inline constexpr int most_newton_steps = 48;

// Returns the f = g(after) that solves after + gamma g(after) = free between `far` and `free`.
// Safeguarded Newton's method, or Chebyshev's if g returns a Curve: a step that would leave the
// bracket, or where g falls too steeply, is replaced by bisection. The force is that of the last
// tangent or parabola. Lanes that have converged do not change any more, so that the result of a
// lane does not depend on the others.
template <class V, class Force>
static inline V force_between(V far, V start, V free, V gamma, Force&& g) {
  constexpr bool is_curved = requires {
    g(free).curvature;
  };
  const V one = V{} + 1;
  V low = select(far < free, far, free);
  V high = select(far < free, free, far);
  V after = select(start < low, low, select(start > high, high, start));
  V force = after - after;  // NaN stays NaN
  auto live = after == after;
  for (int i = 0; i < most_newton_steps && any_of(live); ++i) {
    const auto here = g(after);
    const V over = after - free + gamma * here.value;
    low = select(over < V{}, after, low);
    high = select(over < V{}, high, after);
    const V steep = one + gamma * here.slope;
    const V yield = one / steep;
    V step = over * yield;
    V tangent = here.slope;
    if constexpr (is_curved) {
      const V bend = step * here.curvature / 2;
      const V more = bend * gamma * yield;
      step += select(absolute(more) < one / 2, more * step, V{});
      tangent -= here.curvature * step / 2;
    }
    const V newton = after - step;
    force = select(live, here.value - tangent * step, force);
    const V next =
        select((newton >= low) & (newton <= high) & (steep > V{}), newton, (low + high) / 2);
    const auto is_moving =
        absolute(next - after) > last_step<V>(is_curved) * (absolute(after) + absolute(free));
    after = select(live, next, after);
    live = live & is_moving;
  }
  return force;
}

// Does the same for a g that never falls, whose largest value in the bracket is g(free). The first
// step of Newton's method is from there.
template <class V, class Force>
static inline V rising_force(V free, V gamma, Force&& g) {
  const Slope<V> most = g(free);
  const V way = gamma * most.value;
  return force_between(free - way, free - way / (1 + gamma * most.slope), free, gamma, g);
}

// Returns (P(after) - P(before))/step for after = before + step, and its slope. For short steps,
// where the difference would be rounding noise, and where squares underflow, it returns the force
// at the midpoint instead.
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
  const Slope<V> distant{quotient, (potential.force(after) - quotient) / wide};
  if (!any_of(is_near)) {
    return distant;
  }
  return {select(is_near, potential.force(middle), distant.value),
          select(is_near, potential.slope(middle) / 2, distant.slope)};
}

// Returns the passive force of a potential and a damper, whose force is `damping` times the step.
template <class V, class Potential>
static inline V damped_force(const Potential& potential, V before, V free, V gamma, V damping) {
  return rising_force(free, gamma, [&](V after) {
    const Slope<V> elastic = discrete_gradient(potential, before, after - before);
    return Slope<V>{elastic.value + damping * (after - before), elastic.slope + damping};
  });
}

// Returns the share of the path between two depths that lies inside, where the depth is positive.
template <class V>
static inline V share_inside(V from, V to) {
  const V inside = select(to > V{}, to, V{}) - select(from > V{}, from, V{});
  const auto moves = to != from;
  const V still = select(from > V{}, V{} + 1, V{});
  return select(moves, inside / select(moves, to - from, V{} + 1), still);
}

// Returns that share for the two samples that a centred damper acts over. A contact begins and ends
// at full speed, so a damper that switched on at whole samples would be too strong or too weak.
template <class V>
static inline V share_inside(const LinkState<V>& m, V t) {
  const V depth = m.now + t;
  const auto is_inside = (m.before() + t > V{}) & (depth > V{}) & (m.free + t > V{});
  if (!any_of(is_inside == 0)) {
    return V{} + 1;
  }
  return (share_inside(m.before() + t, depth) + share_inside(depth, m.free + t)) / 2;
}

// Returns the lanes in which the link may touch. In others its force is 0.
template <class V>
static inline auto touching_lanes(const LinkState<V>& m, V t) {
  return (m.before() > -t) | (m.now > -t) | (m.free > -t);
}
template <class V>
static inline bool may_touch(const LinkState<V>& m, V t) {
  return any_of(touching_lanes(m, t));
}

// Returns the passive force of a friction law. Its `grip(wanted, last, half)` is the friction f(v)
// at the speed v that solves v + half f(v) = wanted after the speed `last`. Friction dissipates
// energy at each of several solutions.
template <class V, class Friction>
static inline V rubbed(const Friction& bow, const LinkState<V>& link) {
  return bow.grip((link.speed + link.fast) / 2, link.speed, link.gamma / 2);
}

// Returns the friction for a change of distance `step` in two samples, and its slope.
template <class V, class Friction>
static inline Slope<V> rubbing(const Friction& bow, V step) {
  const Slope<V> friction = bow.friction(step / 2);
  return {friction.value, friction.slope / 2};
}

}  // namespace RESSORT_ROUNDING
}  // namespace RESSORT_ISA
}  // namespace ressort::laws
