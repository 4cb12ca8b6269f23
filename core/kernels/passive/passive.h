// core/kernels: links whose force is not the plain one. A kernel moves everything without them;
// then each looks where its ends would be, finds its force (core/laws), and both ends are moved by
// it, which is the same as if it had been among the others. Those that share masses are solved at
// once (joint.h). A part of *_step.cpp.
#pragma once

#include "core/kernels/passive/web.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

// A kernel's Body says for the functions below, of a link's ends:
//   V distance_now(ends), speed_now(ends)  x_a - x_b and v_a - v_b at the sample's beginning
//   V distance(ends), speed(ends)          the same once all has moved, points too
//   V gamma(ends)                          how far they give way to a force of 1
//   V coupling(ends, ends)                 and to one along another link, if it is known
//   void push(ends, V force)               a by -force and b by force, times their inverse masses
//   CoefficientView<V> coefficients()
//   V awake()                              0 in the first sample after set_state(), -1 if it was
//                                          let go, else 1
// Where masses are nodes of their own:
//   void shift(node, V way)                one of them
//   void feel(node, V force)               and what an output of force hears of that
// and where there are places:
//   V give(from, at)                       how far a node is moved by a force of 1 on another
//   void push_node(node, V force)          one end alone

// Before anything moves. `memory` is [link][passive_rows] packs.
template <class V, class Body>
static inline void remember(const PassiveTables& tables, V* memory, const Body& body) {
  for (const PassiveLink& link : tables.links) {
    memory[0] = body.distance_now(link.ends);
    memory[1] = body.speed_now(link.ends);
    memory += passive_rows;
  }
}

// Whether a link may exert anything in any lane; what comes and goes with the distance exerts
// nothing between far ends. So much is told without its law, which would take longer.
template <class V, class Body>
static inline bool may_act(const PassiveLink& link, const laws::LinkState<V>& state,
                           const Body& body) {
  if (link.zone != Zone::near && link.zone != Zone::below) {
    return true;
  }
  const V reach = body.coefficients()[link.reach];
  if (link.zone == Zone::below) {
    return laws::may_touch(state, reach);
  }
  const V before = state.before();
  const V way = absolute(state.free - before) + absolute(state.now - before);
  return any_of(absolute(state.now) < reach + way);
}

// Whether any of a cluster may: often nothing touches.
template <class V, class Body>
static inline bool may_act(const PassiveTables& tables, const Cluster& cluster, const V* memory,
                           const Body& body) {
  for (std::size_t i = cluster.first; i < cluster.first + cluster.count; ++i) {
    const PassiveLink& link = tables.links[i];
    const V* const row = memory + i * passive_rows;
    const laws::LinkState<V> state{
        .now = row[0], .speed = row[1], .free = body.distance(link.ends)};
    if (may_act(link, state, body)) {
      return true;
    }
  }
  return false;
}
template <class V, class Body>
static inline void let_go(const PassiveTables& tables, const Cluster& cluster, V* memory,
                          Body& body) {
  for (std::size_t i = cluster.first; i < cluster.first + cluster.count; ++i) {
    memory[i * passive_rows + 2] = V{};
    body.push(tables.links[i].ends, V{});
  }
}

template <class V, class Body>
static inline V force_of(const PassiveLink& link, const laws::LinkState<V>& state,
                         const Body& body) {
  const CoefficientView<V> all = body.coefficients();
  const auto c = [&](std::size_t i) { return all[link.coefficients[i]]; };
  return with_law<V>(link.law, c, [&](const auto& law) { return law.passive(state); });
}

// After masses and position inputs have moved, before points do. `numbers` are the room's.
template <class V, class Body>
static inline void correct(const PassiveTables& tables, V* memory, V* numbers, Body& body) {
  const V awake = body.awake();
  if (any_of(awake < V{})) {
    return;  // nobody hears this sample
  }
  const bool is_first = any_of(awake == V{});
  V* row = memory;
  for (std::size_t i = 0; i < tables.alone; ++i, row += passive_rows) {
    const PassiveLink& link = tables.links[i];
    laws::LinkState<V> state{.now = row[0], .speed = row[1], .free = body.distance(link.ends)};
    if (!is_first && !may_act(link, state, body)) {
      body.push(link.ends, V{});
      continue;
    }
    state.fast = body.speed(link.ends);
    state.gamma = body.gamma(link.ends);
    V force = force_of(link, state, body);
    if (is_first) {
      const V first =
          JointSolver<V>::first_force(link, body.coefficients(), state.before(), state.speed,
                                      state.free - state.before(), state.gamma);
      force = select(awake == V{}, first, force);
    }
    body.push(link.ends, force);
  }
  if constexpr (HasMasses<Body, V>) {
    if (tables.web.count > 0) {
      return solve_web(tables, memory, numbers, body);
    }
  }
  JointOf<V, Body> joint(body);
  for (const Cluster& cluster : tables.clusters) {
    if (!is_first && !may_act(tables, cluster, memory, body)) {
      let_go(tables, cluster, memory, body);
      continue;
    }
    JointSolver<V>::solve(tables.links, cluster, memory + cluster.first * passive_rows, numbers,
                          joint);
  }
}

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA
