// core/kernels: webs of nonlinear springs (clusters.h), with one auxiliary variable each. Included
// by *_step.cpp.
#pragma once

#include "core/kernels/passive/joint.h"
#include "core/laws/laws.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

// One sample of a web by the scalar auxiliary variable method (Bilbao, Ducceschi and Zama 2023).
// The springs' potential P >= 0 is represented by one number psi with the energy psi^2/2. With g =
// grad P / sqrt(2 P) at the current positions,
//
//  the force is g (psi+ + psi)/2,  psi+ - psi = g (x+ - x-)/2,
//
// which is linear in x+ and needs neither iteration nor matrix. psi drifts from sqrt(2 P). An
// excess is stored and given back when psi is too small, so that the correction produces no energy.
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

  // Applies the web's force as if nothing else acted.
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

  // Returns the coupling between the web and a force along another link.
  V drag(const PassiveLink& link) const {
    const auto moved = [&](std::uint32_t end) {
      return end == no_mass ? V{} : give_[end] * bent_[end];
    };
    const V root = select(body_.awake() == V{}, V{}, root_);
    return (moved(link.mass_a) - moved(link.mass_b)) * root / square_root(stiff_);
  }
  // Corrects the web for the other links: `felt` is the sum of each drag times its force.
  void follow(V felt) {
    const V more = felt / square_root(stiff_);
    psi() += 2 * more;
    shift([&](std::size_t i) { return more * root_ * bent_[i]; });
  }

 private:
  // Computes the springs' forces on their ends, their energy, and its derivative along the motion.
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
            // A softening spring has negative energy, and uses the published force instead.
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

  // Corrects the drift of psi: removes an excess, or adds what the store holds. In a lane's first
  // sample psi is unknown; in the second it gets the springs' energy.
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
      body_.add_reaction(end, on_it);
    }
  }

  // State kept between samples, in the unused third number of the springs' rows.
  V& psi() { return rows_[2]; }
  V& last() { return rows_[passive_rows + 2]; }       // Energy of the springs.
  V& store() { return rows_[2 * passive_rows + 2]; }  // Stored excess of psi; -1: new.

  const Web& web_;
  const PassiveLink* links_;
  std::size_t ends_;
  V* rows_;
  V* give_;      // [end] compliance
  V* straight_;  // Linear force on each end, proportional to distances and speeds.
  V* bent_;      // Nonlinear force -grad P.
  CoefficientView<V> coefficients_;
  Body& body_;
  V held_{};   // P
  V way_{};    // grad P (x+ - x-) without the springs' own response.
  V root_{};   // 1 / sqrt(2 P).
  V stiff_{};  // 4 + g M^-1 g.
  V pull_{};   // (psi+ + psi) / 2.
};

// Solves the web together with the other passive links.
template <class V, class Body>
[[gnu::noinline]] static void solve_web(const PassiveTables& tables, V* memory, V* numbers,
                                        Body& body) {
  WebStep<V, Body> web(tables, memory, numbers, body);
  web.pull();
  for (const Cluster& cluster : tables.clusters) {  // At most one.
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
