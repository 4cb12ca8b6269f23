// core/kernels: solves passive links that share masses simultaneously. Let s_l be the change of a
// link's distance from the previous sample to the next one, and f_l(s_l) its discrete-gradient
// force (core/laws):
//
//  s = free - C f,  f_l = f_l(s_l),  C = B^T M^-1 B
//
// where B is the incidence matrix of links and masses. If every f_l is increasing, as for a convex
// potential, the solution is the unique minimum of 1/2 |u|^2_M plus the sum of the potentials of
// f_l. Newton's method with a line search finds it (joint_space.h).
//
// A link that exerts f_l instead of f_l(s_l) produces the energy (f_l(s_l) - f_l) s_l. If the
// iteration limit leaves such an error, it is removed: every link then exerts f_l(0) + c s_l, and c
// is raised until no energy is produced. For c to infinity nothing moves, so this terminates.
#pragma once

#include <algorithm>

#include "core/kernels/passive/joint_space.h"
#include "core/laws/laws.h"

namespace ressort::kernels::RESSORT_ISA {

using laws::LinkState;
using laws::Slope;
using laws::Steady;

// Full Newton steps before the line search checks for overshoot.
inline constexpr int free_newtons = 10;
inline constexpr int most_newtons = 64;
inline constexpr int most_stiffenings = 24;

namespace {

// Links exert no force in a lane's first sample, since the previous motion is unknown. But the
// potential energy must not exceed the lower of its values at the start and one sample earlier (by
// the initial speed). The difference is taken out of the motion. `step` is from that earlier
// sample.
template <class V, class ForceLaw>
static inline Slope<V> first_gradient(const ForceLaw& law, V before, V speed, V step) {
  const auto falls = law.gradient(before, speed).value * speed < V{};
  const V lead = select(falls, speed, V{});
  const V way = step - lead;
  const Slope<V> at = law.gradient(before + lead, way);
  const auto rises = (at.value * way > V{}) & ((falls == (V{} != V{})) | (way * speed > V{}));
  const V wide = select(falls & rises, step, V{} + 1);
  const V share = select(falls, at.value * way / wide, at.value);
  const V slope = select(falls, (at.value + at.slope * way - share) / wide, at.slope);
  return {select(rises, share, V{}), select(rises, slope, V{})};
}

// Evaluates the laws of a cluster's links, independent of the solution space.
template <class V>
class JointLaws {
 public:
  JointLaws(const PassiveLink* links, CoefficientView<V> coefficients)
      : links_(links), coefficients_(coefficients) {}

  Steady<V> steady(std::size_t i, const LinkState<V>& state) const {
    return with(i, [&](const auto& law) { return law.steady(state); });
  }
  Slope<V> gradient(std::size_t i, V before, V step) const {
    return with(i, [&](const auto& law) { return law.gradient(before, step); });
  }
  [[gnu::noinline]] Slope<V> first(std::size_t i, V before, V speed, V step) const {
    return with(i, [&](const auto& law) { return first_gradient(law, before, speed, step); });
  }
  [[gnu::noinline]] V alone(std::size_t i, const LinkState<V>& state) const {
    return with(i, [&](const auto& law) { return law.passive(state); });
  }

 private:
  template <class Use>
  auto with(std::size_t i, Use&& use) const {
    const auto c = [&](std::size_t k) { return coefficients_[links_[i].coefficients[k]]; };
    return with_law<V>(links_[i].law, c, use);
  }

  const PassiveLink* links_;
  CoefficientView<V> coefficients_;
};

// The links of a cluster in one sample. `memory` belongs to them: [link][passive_rows].
template <class V, class Space>
class Joint {
 public:
  using Lanes = decltype(V{} == V{});

  Joint(const PassiveLink* links, std::size_t count, V* memory, Joined<V>* joined, Space& space,
        JointBody<V>& body)
      : links_(links),
        count_(count),
        memory_(memory),
        joined_(joined),
        space_(space),
        body_(body),
        laws_(links, body.coefficients()),
        is_first_(body.awake() == V{}) {}

  void solve() {
    set_start();
    Lanes live = evaluate(V{} == V{});
    const Lanes lost = live & is_lost_;
    if (any_of(lost)) {
      restart_one_by_one(lost);
      evaluate(lost);
    }
    if (any_of(live)) {
      live = iterate_newton(live);
    }
    const Lanes astray = live & fails(is_first_);
    if (any_of(astray)) {
      restart_from_rest(astray);
      evaluate(astray);
      // Includes lanes where nothing moves and so no energy is produced.
      is_far_ = is_far_ | astray;
      live = (live & is_first_) | iterate_newton(astray);
    }
    if (any_of(is_first_)) {
      live = live | (is_first_ & makes_energy());
    }
    if (any_of(live & is_lost_)) {
      restart_from_rest(live & is_lost_);
    }
    if (any_of(live)) {
      stiffen(live);
    }
    for (std::size_t i = 0; i < count_; ++i) {
      memory_[i * passive_rows + 2] = joined_[i].force - joined_[i].steady;
    }
    space_.push(joined_, body_);
  }

 private:
  // At this relative distance one more Newton step reaches rounding precision, with errors of
  // either sign. Stopping earlier would add or remove a little energy in every sample.
  static constexpr auto nearness =
      static_cast<Scalar<V>>(sizeof(Scalar<V>) == 4 ? 0x1p-14 : 0x1p-34);
  static constexpr Scalar<V> endless = sizeof(Scalar<V>) == 4 ? Scalar<V>(1e30) : Scalar<V>(1e150);

  // Negates a condition such that NaN counts as a failure.
  static Lanes fails(Lanes holds) { return holds == (V{} != V{}); }

  // Returns the state without the response to the link's own force.
  LinkState<V> state_of(std::size_t i) const {
    const FreeMotion<V> motion = body_.free_motion(links_[i].ends);
    const V* const row = memory_ + i * passive_rows;
    return {.now = row[0],
            .speed = row[1],
            .free = motion.distance,
            .fast = motion.speed,
            .gamma = V{}};
  }

  // Starting point: the forces of the previous sample, plus known changes. Links without a force,
  // and those whose law has several solutions, start from their solution alone.
  void set_start() {
    for (std::size_t i = 0; i < count_; ++i) {
      const LinkState<V> state = state_of(i);
      Joined<V>& link = joined_[i];
      link.before = state.before();
      link.speed = state.speed;
      const bool rubs = facts_of(links_[i].law).is_friction;
      link.free = rubs ? state.speed + state.fast : state.free - state.before();
      const Steady<V> steady = laws_.steady(i, state);
      link.steady = select(is_first_, V{}, steady.force);
      link.damping = select(is_first_, V{}, positive(steady.damping));
      link.force = V{};
      link.way = V{};
    }
    space_.rest(V{} == V{});
    for (std::size_t i = 0; i < count_; ++i) {
      if (facts_of(links_[i].law).is_convex) {
        exert(i, select(is_first_, V{}, joined_[i].steady + memory_[i * passive_rows + 2]));
      }
    }
    for (std::size_t i = 0; i < count_; ++i) {
      const auto is_known = (joined_[i].force != V{}) | is_first_;
      if (any_of(is_known == (V{} != V{}))) {
        exert(i, select(is_known, V{}, alone(i)));
      }
    }
    find_steps();
  }
  void exert(std::size_t i, V force) {
    joined_[i].force += force;
    if (any_of(force != V{})) {
      space_.pull(i, force);
    }
  }
  void find_steps() {
    for (std::size_t i = 0; i < count_; ++i) {
      joined_[i].step = joined_[i].free + space_.pulled(i);
    }
  }
  // Returns the force of a link if all others keep their current forces.
  V alone(std::size_t i) const {
    LinkState<V> state = state_of(i);
    state.gamma = body_.gamma(links_[i].ends);
    state.free += space_.pulled(i);
    state.fast += space_.pulled(i);
    return laws_.alone(i, state);
  }

  // Evaluates all laws. Returns the lanes in which the error of the forces produces more energy
  // than rounding can.
  Lanes evaluate(Lanes live) {
    V error{};
    V scale{};
    V power{};
    V far{};
    along_ = V{};
    bend_ = V{};
    for (std::size_t i = 0; i < count_; ++i) {
      Joined<V>& link = joined_[i];
      const Slope<V> at = laws_.gradient(i, link.before, link.step);
      link.value = link.steady + link.damping * link.step + at.value;
      link.slope = positive(link.damping + at.slope);
      if (any_of(is_first_)) {
        const Slope<V> first = laws_.first(i, link.before, link.speed, link.step);
        link.value = select(is_first_, first.value, link.value);
        link.slope = select(is_first_, positive(first.slope), link.slope);
      }
      const V off = absolute(link.value - link.force) * absolute(link.step);
      const V own = (absolute(link.value) + absolute(link.force)) * absolute(link.step);
      error += off;
      power += own;
      far += positive(off - nearness * own);
      scale += (absolute(link.value) + absolute(link.force)) *
               (absolute(link.before) + absolute(link.step));
      along_ += link.way * link.value;
      bend_ += link.way * link.way * link.slope;
    }
    along_ += space_.inertia_along(joined_);
    is_lost_ = fails(error <= power / 4);
    is_far_ = fails(far <= share_of_rounding<V> * scale);
    return live & fails((error <= share_of_rounding<V> * scale) & (scale < endless));
  }

  // Second starting point, for lanes where Newton's method fails, for example in the sample after a
  // hard impact: from zero forces, one link after the other takes its solution alone (nonlinear
  // Gauss-Seidel), which decreases the objective at every step.
  void restart_one_by_one(Lanes lost) {
    space_.rest(lost);
    for (std::size_t i = 0; i < count_; ++i) {
      const V force = select(lost & fails(is_first_), alone(i), V{});
      joined_[i].force = select(lost, force, joined_[i].force);
      space_.pull(i, force);
    }
    find_steps();
  }

  // Third starting point, after an impact too hard for the second: from a state where hardly
  // anything moves, with every link held equally. The forces there are limited so that the masses'
  // inertia is not lost to rounding.
  void restart_from_rest(Lanes lost) {
    constexpr auto hold = static_cast<Scalar<V>>(sizeof(Scalar<V>) == 4 ? 0x1p10 : 0x1p24);
    for (std::size_t i = 0; i < count_; ++i) {
      Joined<V>& link = joined_[i];
      link.force = select(lost, V{}, link.force);
    }
    move(lost);
    for (std::size_t i = 0; i < count_; ++i) {
      Joined<V>& link = joined_[i];
      link.slope = hold * stiffness_to_hold(i);
      link.value = link.slope * link.step;
    }
    take_full_step(lost);
  }
  // Returns the stiffness that holds a link, relative to the response of its ends.
  V stiffness_to_hold(std::size_t i) const {
    const V give = body_.gamma(links_[i].ends);
    return 1 / select(give > V{}, give, V{} + 1);
  }
  // Takes one full step with the current `value` and `slope`.
  void take_full_step(Lanes live) {
    space_.solve(joined_, true);
    for (std::size_t i = 0; i < count_; ++i) {
      joined_[i].way = joined_[i].newton_way;
      joined_[i].push = joined_[i].newton_push;
      move_along(joined_[i], live, V{} + 1);
    }
    move(live);
  }

  // Recomputes positions from forces instead of accumulating changes, so that rounding errors do
  // not add up.
  void move(Lanes live) {
    space_.follow(joined_, live);
    find_steps();
  }

  // Iterates Newton's method; returns the lanes that have not converged.
  Lanes iterate_newton(Lanes live) {
    const V one = V{} + 1;
    const V steepest = V{} - Scalar<V>(1e30);
    V last = steepest;  // Initial slope of the objective along the direction.
    V share = one;      // Step length taken so far.
    V inertia{};        // Curvature of the objective along the direction, laws excluded.
    for (int round = 0; round < most_newtons && any_of(live); ++round) {
      // Usually the full step is right. If not, part of it is taken back so that it ends near the
      // minimum along the direction: by a scalar Newton step, limited to the minimum of a quartic.
      const Scalar<V> most_rise = round > free_newtons ? Scalar<V>(0.5) : Scalar<V>(16);
      const auto is_beyond = fails(along_ <= V{} - most_rise * last);
      const V rise = select(along_ > V{} - last, along_, V{} - last);
      const V far = one - square_root(square_root((V{} - last) / rise));
      const V most = Scalar<V>(0.9999) * share;
      V back = along_ / (inertia + bend_);
      back = select(back > far * share, back, far * share);
      const V go = select(is_beyond, V{} - select(back < most, back, most), one);
      if (any_of(live & fails(is_beyond))) {
        space_.solve(joined_, round > free_newtons);
      }
      auto moves = V{} != V{};
      V falls{};
      V bends{};
      for (std::size_t i = 0; i < count_; ++i) {
        Joined<V>& link = joined_[i];
        link.way = select(is_beyond, link.way, link.newton_way);
        link.push = select(is_beyond, link.push, link.newton_push);
        falls += link.way * link.value;
        bends += link.way * link.way * link.slope;
      }
      space_.turn(is_beyond);
      falls += space_.inertia_along(joined_);
      for (std::size_t i = 0; i < count_; ++i) {
        moves = moves | move_along(joined_[i], live, go);
      }
      last = select(is_beyond, last, falls);
      share = select(is_beyond, share + go, one);
      inertia = select(is_beyond, inertia, V{} - falls - bends);
      space_.go(joined_, live, go);
      find_steps();
      live = live & is_far_ & (moves | is_beyond);
      if (any_of(live)) {
        live = evaluate(live);
      }
    }
    return live;
  }

  // Moves by a share of the direction. Returns the lanes in which that changes more than the last
  // digit.
  Lanes move_along(Joined<V>& link, Lanes live, V share) {
    link.force = select(live, link.force + share * link.push, link.force);
    return absolute(link.way) > tiny_share<V>() / 2 * (absolute(link.before) + absolute(link.step));
  }

  // Replaces the laws by linear ones: each link exerts its force at the previous position, minus a
  // multiple of its step that grows while energy is produced. This system is solved directly. In
  // the limit nothing moves; in the first sample, from its start.
  void stiffen(Lanes live) {
    for (std::size_t i = 0; i < count_; ++i) {
      memory_[i * passive_rows + 2] = joined_[i].force;
    }
    auto hold = static_cast<Scalar<V>>(0x1p-30);
    for (int round = 0; round < most_stiffenings && any_of(live); ++round, hold *= 8) {
      for (std::size_t i = 0; i < count_; ++i) {
        Joined<V>& link = joined_[i];
        const V rest = exerted(i, V{});
        const V wide = select(link.step == V{}, V{} + 1, link.step);
        const V secant = positive((exerted(i, link.step) - rest) / wide);
        const V held = hold * stiffness_to_hold(i);
        link.slope = select(is_first_, held, secant + held);
        link.value = select(is_first_, memory_[i * passive_rows + 2] + held * from_start(link),
                            rest + link.slope * link.step);
      }
      take_full_step(live);
      live = live & makes_energy();
    }
  }

  V exerted(std::size_t i, V step) const {
    const Joined<V>& link = joined_[i];
    const V at = laws_.gradient(i, link.before, step).value;
    return link.steady + link.damping * step + at;
  }

  // The potential of the first sample counts from the start position only.
  V from_start(const Joined<V>& link) const {
    return link.step - select(is_first_, link.speed, V{});
  }
  Lanes makes_energy() const {
    V made{};
    V scale{};
    for (std::size_t i = 0; i < count_; ++i) {
      const Joined<V>& link = joined_[i];
      const V way = from_start(link);
      const V at = laws_.gradient(i, link.before + (link.step - way), way).value;
      const V value = select(is_first_, V{}, link.steady + link.damping * link.step);
      made += at * way + (value - link.force) * link.step;
      scale += (absolute(at) + absolute(value) + absolute(link.force)) *
               (absolute(link.before) + absolute(link.step));
    }
    return fails((made <= share_of_rounding<V> * scale) & (scale < endless));
  }

  const PassiveLink* links_;
  std::size_t count_;
  V* memory_;
  Joined<V>* joined_;
  Space& space_;
  JointBody<V>& body_;
  JointLaws<V> laws_;
  Lanes is_first_;
  V along_{};  // Slope of the objective at the current point along the last direction.
  V bend_{};   // Contribution of the laws to the curvature.
  Lanes is_far_{};
  Lanes is_lost_{};  // Lanes in which most forces are far from their laws.
};

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA
