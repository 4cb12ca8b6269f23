// core/kernels: webs of springs that bend (clusters.h), in one number each. A part of *_step.cpp.
#pragma once

#include "core/kernels/passive/joint.h"
#include "core/laws/laws.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

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
        coefficients_(body.coefficients()),
        body_(body) {}

  // As if nothing else acted.
  void pull() {
    const Lanes is_first = body_.awake() == V{};
    for (std::size_t i = 0; i < ends_; ++i) {
      const std::uint32_t inverse_mass = web_.inverse_mass[i];
      give_[i] = inverse_mass == no_mass ? V{} : coefficients_[inverse_mass];
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
      const auto c = [&](std::size_t k) { return coefficients_[link->coefficients[k]]; };
      with_law<V>(link->law, c, [&](const auto& law) {
        if constexpr (requires { law.curved(V{}); }) {
          for (std::uint32_t i = 0; i < count; ++i, ++link, row += passive_rows) {
            const laws::LinkState<V> state{.now = row[0], .speed = row[1]};
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
  CoefficientView<V> coefficients_;
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
    JointOf<V, Body> joint(body);
    JointSolver<V>::solve(tables.links, cluster, memory, rest, joint, drag);
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

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA
