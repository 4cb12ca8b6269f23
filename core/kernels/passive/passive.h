// core/kernels: links with a passive (energy-conserving) force. A kernel first moves everything
// without them. Each passive link then sees where its ends would be and computes its force
// (core/laws); both ends are moved by it, which equals including it in the sum of forces. Links
// that share masses are solved simultaneously (joint.h). Included by *_step.cpp.
#pragma once

#include "core/kernels/passive/web.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

// A kernel's Body provides, for a link's ends:
//  V distance_now(ends), speed_now(ends)  x_a - x_b and v_a - v_b at the start of the sample
//  V distance(ends), speed(ends)          the same after everything has moved, points included
//  V gamma(ends)                          their response to a unit force
//  V coupling(ends, ends)                 and to a unit force along another link, if known
//  void push(ends, V force)               moves a by -force and b by force, times inverse masses
//  CoefficientView<V> coefficients()
//  V awake()                              0 in the first sample after set_state(), -1 if it was
//                                         released, else 1
// If masses are nodes of their own:
//  void shift(node, V way)                moves one of them
//  void add_reaction(node, V force)               adds a force to an output of the node's force
// And if there are places:
//  V give(from, at)                       displacement of a node by a unit force on another
//  void push_node(node, V force)          moves one end only

// Stores the distances before anything moves. `memory` is [link][passive_rows] packs.
template <class V, class Body>
static inline void remember(const PassiveTables& tables, V* memory, const Body& body) {
  for (const PassiveLink& link : tables.links) {
    memory[0] = body.distance_now(link.ends);
    memory[1] = body.speed_now(link.ends);
    memory += passive_rows;
  }
}

// Returns the lanes in which a link can exert a force, by its distance. Its zone is `below` or
// `near`.
template <class V>
static inline decltype(V{} < V{})
    acting_lanes(bool is_below, const laws::LinkState<V>& state, V reach) {
  if (is_below) {
    return laws::touching_lanes(state, reach);
  }
  const V before = state.before();
  const V way = absolute(state.free - before) + absolute(state.now - before);
  return absolute(state.now) < reach + way;
}

// Returns whether a link can exert a force in any lane. Laws with a limited zone are tested by
// distance, which is faster than evaluating them.
template <class V, class Body>
static inline bool may_act(const PassiveLink& link, const laws::LinkState<V>& state,
                           const Body& body) {
  return (link.zone != Zone::near && link.zone != Zone::below) ||
         any_of(acting_lanes(link.zone == Zone::below, state, body.coefficients()[link.reach]));
}

// Returns whether any link of a cluster can act; often nothing touches.
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
static inline void clear_forces(const PassiveTables& tables, const Cluster& cluster, V* memory,
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

// Applies all passive links, after masses and position inputs have moved and before points do.
// `numbers` are those of the room.
template <class V, class Body>
static inline void correct(const PassiveTables& tables, V* memory, V* numbers, Body& body) {
  const V awake = body.awake();
  if (any_of(awake < V{})) {
    return;  // The first sample is not an output.
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
      clear_forces(tables, cluster, memory, body);
      continue;
    }
    JointSolver<V>::solve(tables.links, cluster, memory + cluster.first * passive_rows, numbers,
                          joint);
  }
}

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA
