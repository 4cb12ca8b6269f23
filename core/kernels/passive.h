// core/kernels: links whose force is not the plain one. A kernel moves everything without them;
// then each looks where its ends would be, finds its force (core/laws), and both ends are moved by
// it, which is the same as if it had been among the others. Those that share masses are solved at
// once (joint.h).
#pragma once

#include <algorithm>
#include <vector>

#include "core/kernels/joint.h"

namespace ressort {

// What passive links keep from one sample to the next, and what solving them needs.
template <class T>
struct PassiveRoom {
  PassiveRoom(const Program& program, std::size_t width)
      : tables(passive_tables(program)),
        memory(tables.links.size() * passive_rows * width),
        awake(width) {
    if (tables.links.empty()) {
      return;
    }
    std::size_t most = 0;
    for (const Cluster& cluster : tables.clusters) {
      most = std::max(most, cluster.numbers());
    }
    numbers.resize(most * widest_bytes / sizeof(T));
    inverse_mass = inverse_masses(program);
    const auto is_force = [](const OutputSlot& output) { return output.is_force; };
    if (std::any_of(program.outputs.begin(), program.outputs.end(), is_force)) {
      felt.resize(program.position.size() * width);
    }
  }
  T* felt_or_null() { return felt.empty() ? nullptr : felt.data(); }

  PassiveTables tables;
  std::vector<std::uint32_t> inverse_mass;
  Aligned<T> memory;   // [pack][link][passive_rows][lane]
  Aligned<T> numbers;  // of one cluster of one pack, while it is solved
  Aligned<T> awake;
  Aligned<T> felt;
};

// A kernel's Body says for the functions below, of a link's ends:
//   V distance_now(ends), speed_now(ends)  x_a - x_b and v_a - v_b at the sample's beginning
//   V distance(ends), speed(ends)          the same once all has moved, points too
//   V gamma(ends)                          how far they give way to a force of 1
//   void push(ends, V force)               a by -force and b by force, times their inverse masses
//   V coefficient(c)
//   V awake()                              0 in the first sample after set_state(), -1 if it was
//   let
//                                          go, else 1
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

template <class V, class Body>
static inline V force_of(const PassiveLink& link, const LinkState<V>& state, const Body& body) {
  const auto c = [&](std::size_t i) { return body.coefficient(link.coefficients[i]); };
  return with_law<V>(link.law, c, [&](const auto& law) { return law.passive(state); });
}

// The same in a lane's first sample.
template <class V, class Body>
[[gnu::noinline]] static V first_force(const PassiveLink& link, const LinkState<V>& state,
                                       const Body& body) {
  const auto c = [&](std::size_t i) { return body.coefficient(link.coefficients[i]); };
  const V free = state.free - state.before();
  const V force = with_law<V>(link.law, c, [&](const auto& law) {
    return laws::force_between(V{}, free, free, state.gamma, [&](V step) {
      return first_gradient(law, state.before(), state.speed, step);
    });
  });
  // What starts on a slope may be held by less than all that would pull there: it stays where it
  // was, and is not thrown back.
  const auto is_thrown = absolute(force) * state.gamma > absolute(free);
  return select(is_thrown, free / select(is_thrown, state.gamma, V{} + 1), force);
}

// After masses and position inputs have moved, before points do. `numbers` are the room's.
template <class V, class Body>
static inline void correct(const PassiveTables& tables, V* memory, V* numbers, Body& body) {
  const V awake = body.awake();
  if (any_of(awake < V{})) {
    return;  // nobody hears this sample
  }
  V* row = memory;
  for (std::size_t i = 0; i < tables.alone; ++i, row += passive_rows) {
    const PassiveLink& link = tables.links[i];
    const LinkState<V> state{.now = row[0],
                             .speed = row[1],
                             .free = body.distance(link.ends),
                             .fast = body.speed(link.ends),
                             .gamma = body.gamma(link.ends)};
    V force = force_of(link, state, body);
    if (any_of(awake == V{})) {
      force = select(awake == V{}, first_force(link, state, body), force);
    }
    body.push(link.ends, force);
  }
  for (const Cluster& cluster : tables.clusters) {
    solve_cluster(tables.links, cluster, memory + cluster.first * passive_rows, numbers, body);
  }
}

}  // namespace ressort
