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
      most = std::max(most, cluster.numbers() + cluster.count);
    }
    most += tables.web.numbers();
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
//   V coupling(ends, ends)                 and to one along another link, if it is known
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

// A web in one sample. Of its springs' potential P >= 0 one number psi is kept, and psi^2/2 is what
// they hold: with g = grad P/sqrt(2 P) where the ends are,
//
//   they pull with g (psi+ + psi)/2,  psi+ - psi = g (x+ - x-)/2,
//
// which is linear in x+, so that it takes no iteration and no matrix: a scalar auxiliary variable
// (Bilbao, Ducceschi and Zama 2023). psi drifts from sqrt(2 P); what is too much of it is kept, and
// given back where it is too little, so that it is brought back without making energy.
template <class V, class Body>
class WebStep {
 public:
  using Lanes = decltype(V{} == V{});

  WebStep(const PassiveTables& tables, V* memory, V* numbers, Body& body)
      : web_(tables.web),
        links_(tables.links.data() + web_.first),
        ends_(web_.inverse_mass.size()),
        rows_(memory + web_.first * passive_rows),
        give_(numbers),
        straight_(give_ + ends_),
        bent_(straight_ + ends_),
        body_(body) {}

  // As if nothing else acted.
  void pull() {
    const Lanes is_first = body_.awake() == V{};
    for (std::size_t i = 0; i < ends_; ++i) {
      const std::uint32_t inverse_mass = web_.inverse_mass[i];
      give_[i] = inverse_mass == no_mass ? V{} : body_.coefficient(inverse_mass);
      straight_[i] = V{};
      bent_[i] = V{};
    }
    find_forces();
    V give{};
    V way = way_;
    for (std::size_t i = 0; i < ends_; ++i) {
      const V moved = give_[i] * bent_[i];
      give += bent_[i] * moved;
      way -= straight_[i] * moved;
    }
    constexpr auto nothing = static_cast<Scalar<V>>(sizeof(Scalar<V>) == 4 ? 1e-30 : 1e-250);
    const auto holds = held_ > nothing;
    root_ = select(holds, 1 / square_root(2 * select(holds, held_, V{} + 1)), V{});
    stiff_ = 4 + give * root_ * root_;
    set_right(is_first);
    pull_ = select(is_first, V{}, (4 * psi() + way * root_) / stiff_);
    psi() = 2 * pull_ - psi();
    store() = select(is_first, V{} - 1, store());
    for (std::size_t i = 0; i < ends_; ++i) {
      straight_[i] = select(is_first, V{}, straight_[i]);
    }
    shift([&](std::size_t i) { return straight_[i] + pull_ * root_ * bent_[i]; });
  }

  // How much of a force along another link the web feels, and of what it feels others do.
  V drag(const PassiveLink& link) const {
    const auto moved = [&](std::uint32_t end) {
      return end == no_mass ? V{} : give_[end] * bent_[end];
    };
    const V root = select(body_.awake() == V{}, V{}, root_);
    return (moved(link.mass_a) - moved(link.mass_b)) * root / square_root(stiff_);
  }
  // What the web does of what other links did: `felt` is the sum of each drag times its force.
  void follow(V felt) {
    const V more = felt / square_root(stiff_);
    psi() += 2 * more;
    shift([&](std::size_t i) { return more * root_ * bent_[i]; });
  }

 private:
  // Those of all springs on their ends, what they hold, and how it would rise by where these go.
  void find_forces() {
    const PassiveLink* link = links_;
    V* row = rows_;
    V held{};
    V way{};
    for (const std::uint32_t count : web_.alike) {
      const auto c = [&](std::size_t k) { return body_.coefficient(link->coefficients[k]); };
      with_law<V>(link->law, c, [&](const auto& law) {
        if constexpr (requires { law.curved(V{}); }) {
          for (std::uint32_t i = 0; i < count; ++i, ++link, row += passive_rows) {
            const LinkState<V> state{.now = row[0], .speed = row[1]};
            // What softens holds less than nothing, and pulls as published.
            const V kept = law.curved(row[0]);
            const auto holds = kept >= V{};
            const V slope = law.gradient(row[0], V{}).value;
            const V bent = select(holds, slope, V{});
            const V straight = law.steady(state).force + (slope - bent);
            held += positive(kept);
            way += bent * (row[1] + body_.speed(link->ends));
            straight_[link->mass_a] -= straight;
            straight_[link->mass_b] += straight;
            bent_[link->mass_a] -= bent;
            bent_[link->mass_b] += bent;
          }
        }
        return V{};
      });
    }
    held_ = held;
    way_ = way;
  }

  // What psi has too much, or too little as far as there is a store. In a lane's first sample
  // nothing is known of it; in the second it holds what the springs do.
  void set_right(Lanes is_first) {
    const V wanted = (last() + held_) / 2;
    const auto is_new = store() < V{};
    store() = select(is_new, V{}, store());
    const V has = select(is_new, wanted, psi() * psi() / 2);
    const V missing = wanted - has;
    const V given = select(missing < store(), missing, store());
    store() -= given;
    psi() = select(is_first, V{}, square_root(2 * positive(has + given)));
    last() = held_;
  }

  template <class Force>
  void shift(Force&& force) {
    for (std::size_t i = 0; i < ends_; ++i) {
      const PassiveLink& link = links_[web_.of[i] / 2];
      const std::uint32_t end = web_.of[i] % 2 == 0 ? link.ends.a : link.ends.b;
      const V on_it = force(i);
      if (web_.inverse_mass[i] != no_mass) {
        body_.shift(end, give_[i] * on_it);
      }
      body_.feel(end, on_it);
    }
  }

  // What is kept from sample to sample: of a spring its third number is free.
  V& psi() { return rows_[2]; }
  V& last() { return rows_[passive_rows + 2]; }       // what the springs held
  V& store() { return rows_[2 * passive_rows + 2]; }  // what psi had too much; -1: it is new

  const Web& web_;
  const PassiveLink* links_;
  std::size_t ends_;
  V* rows_;
  V* give_;      // [end]
  V* straight_;  // what pulls it, in proportion to distances and speeds
  V* bent_;      // and what bends: -grad P
  Body& body_;
  V held_{};   // P
  V way_{};    // grad P (x+ - x-), but for what the springs themselves do
  V root_{};   // 1/sqrt(2 P)
  V stiff_{};  // 4 + g M^-1 g
  V pull_{};   // (psi+ + psi)/2
};

// The web, and what else is passive, as it drags on that.
template <class V, class Body>
[[gnu::noinline]] static void solve_web(const PassiveTables& tables, V* memory, V* numbers,
                                        Body& body) {
  WebStep<V, Body> web(tables, memory, numbers, body);
  web.pull();
  for (const Cluster& cluster : tables.clusters) {  // one, or none
    V* const drag = numbers + tables.web.numbers();
    V* const rest = drag + cluster.count;
    for (std::size_t i = 0; i < cluster.count; ++i) {
      drag[i] = web.drag(tables.links[i]);
    }
    solve_cluster(tables.links, cluster, memory, rest, body, drag);
    const auto* const joined = reinterpret_cast<const Joined<V>*>(rest);
    V felt{};
    for (std::size_t i = 0; i < cluster.count; ++i) {
      felt += drag[i] * joined[i].force;
    }
    if (any_of(felt != V{})) {
      web.follow(felt);
    }
  }
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
  if constexpr (requires { body.shift(0u, V{}); }) {
    if (tables.web.count > 0) {
      return solve_web(tables, memory, numbers, body);
    }
  }
  for (const Cluster& cluster : tables.clusters) {
    solve_cluster(tables.links, cluster, memory + cluster.first * passive_rows, numbers, body);
  }
}

}  // namespace ressort
