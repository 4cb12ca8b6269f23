// Loops shared by the steps of the chains kernel. Included by *_step.cpp, which are compiled for
// each instruction set.
#pragma once

#include <algorithm>
#include <limits>
#include <utility>

#include "core/kernels/chains/chains.h"
#include "core/laws/laws.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

// A copy of a vector's pointer and size. The compiler can assume that stores into packs do not
// change it.
template <class Row>
struct Table {
  explicit Table(const std::vector<Row>& rows)
      : first(rows.data()), last(rows.data() + rows.size()) {}
  const Row* begin() const { return first; }
  const Row* end() const { return last; }

  const Row* first;
  const Row* last;
};

template <class T, std::size_t Bytes>
struct View {
  using Number = T;
  using V = Pack<T, Bytes>;
  static constexpr std::size_t lanes = Bytes / sizeof(T);

  View(const ChainsTables& tables, ChainsState<T>& state)
      : chains(tables.chains),
        sites(tables.sites),
        loose_runs(tables.loose_runs),
        loose(tables.loose.data()),
        link_runs(tables.link_runs),
        ends(tables.ends.data()),
        taps(tables.taps),
        tap_nodes(tables.tap_nodes.data()),
        listened(tables.listened),
        positions(tables.positions),
        forces(tables.forces),
        heard_positions(tables.heard_positions),
        heard_forces(tables.heard_forces),
        bodies(state.bodies),
        masks(state.masks),
        units(state.units),
        held(state.held),
        force(state.force),
        corners(state.corners),
        tap_pull(state.tap_pull),
        coefficient(state.ramps.value) {}

  Table<FoldedChain> chains;
  Table<ChainSite> sites;
  Table<LoosePlaces> loose_runs;
  const ChainPlace* loose;
  Table<LinkRun> link_runs;
  const PlacedEnds* ends;
  Table<PlacedTap> taps;
  const PlacedNode* tap_nodes;
  Table<std::uint32_t> listened;
  Table<PlacedInput> positions;
  Table<PlacedInput> forces;
  Table<HeardPosition> heard_positions;
  Table<HeardForce> heard_forces;
  T* bodies;
  const T* masks;
  const T* units;
  T* held;
  T* force;
  Corners<T>* corners;
  T* tap_pull;
  const T* coefficient;
};

// Returns x in every lane. V{} + x would turn -0 into 0.
template <class V>
V all(Scalar<V> x) {
  return x - V{};
}

template <class V>
V& pack_at(Scalar<V>* numbers) {
  return *reinterpret_cast<V*>(numbers);
}
template <class V>
const V& pack_at(const Scalar<V>* numbers) {
  return *reinterpret_cast<const V*>(numbers);
}

// Returns y shifted by one lane upwards; lane 0 is that of `first`.
template <class V, std::size_t... I>
V up(V first, V y, std::index_sequence<I...>) {
  return __builtin_shufflevector(first, y, 0, (sizeof...(I) + 1 + I)...);
}
// Returns y shifted by one lane downwards; the last lane is lane 0 of `last`.
template <class V, std::size_t... I>
V down(V y, V last, std::index_sequence<I...>) {
  return __builtin_shufflevector(y, last, (I + 1)..., sizeof...(I) + 1);
}

// Returns K x + Z v of the node that holds an end; a free end has a neighbour that moves with it.
template <class S>
typename S::V tension_of(ChainPlace place, const typename S::Number* held, typename S::V itself,
                         const S& s) {
  return place == nowhere
             ? itself
             : all<typename S::V>(held[0] * s.bodies[place] + held[1] * s.bodies[place + S::lanes]);
}

template <class S>
void step_loose(S& s) {
  using T = typename S::Number;
  T* force = s.force + (s.sites.last - s.sites.first);
  const ChainPlace* place = s.loose;
  for (const LoosePlaces& run : s.loose_runs) {
    const MassRun& mass = run.mass;
    const T inverse_mass = s.coefficient[mass.inverse_mass];
    const T k = mass.is_oscillator ? s.coefficient[mass.stiffness] : 0;
    const T z = mass.is_oscillator ? s.coefficient[mass.damping] : 0;
    const T g = mass.has_gravity ? s.coefficient[mass.gravity] : 0;
    for (std::uint32_t i = 0; i < run.count; ++i) {
      T& x = s.bodies[*place];
      T& v = s.bodies[*place++ + S::lanes];
      v += (*force - k * x - z * v - g) * inverse_mass;
      x += v;
      *force++ = 0;
    }
  }
}

// The range of distances in which a law has a force.
template <class T>
struct Reach {
  T low;
  T high;
};

template <class ForceLaw, class S>
Reach<typename S::Number> reach_of(const LinkRun& run, const S& s) {
  using T = typename S::Number;
  constexpr T far = std::numeric_limits<T>::infinity();
  constexpr const LawFacts& law = ForceLaw::facts;
  if constexpr (law.can_detach()) {
    const T reach = s.coefficient[run.coefficients[law.slot(Role::reach)]];
    return {-reach, law.zone == Zone::near ? reach : far};
  } else {
    return {-far, far};
  }
}

// Adds the forces of links in the first lane of a pack, without branches inside a law. One branch
// per link tests whether the bodies are near enough to touch. It is predicted well, because contact
// seldom changes, and the next sample then does not wait for a force.
template <class S, class ForceLaw>
void add_forces(const LinkRun& run, S& s, const ForceLaw& law) {
  using P = Pack<typename S::Number, 16>;
  const auto reach = reach_of<ForceLaw>(run, s);
  const PlacedEnds* const last = s.ends + run.first + run.count;
  for (const PlacedEnds* ends = last - run.count; ends != last; ++ends) {
    const auto* const a = s.bodies + ends->a;
    const auto* const b = s.bodies + ends->b;
    const auto d = a[0] - b[0];
    if (d <= reach.low || d >= reach.high) {
      continue;
    }
    const auto f = law.force(P{d}, P{a[S::lanes] - b[S::lanes]})[0];
    s.force[ends->force_a] -= f;
    s.force[ends->force_b] += f;
  }
}

template <class S>
void step_links(S& s) {
  using P = Pack<typename S::Number, 16>;
  for (const LinkRun& run : s.link_runs) {
    const auto c = [&](std::size_t i) { return all<P>(s.coefficient[run.coefficients[i]]); };
    with_law<P>(run.law, c, [&](const auto& law) { add_forces(run, s, law); });
  }
}

template <class S, class T>
T force_at(const Program& program, const ChainsTables& tables, const S& s, const T* value,
           const HeardForce& output) {
  const T* const here = s.bodies + output.place;
  T force = s.force[output.force];
  for (std::uint32_t i = output.first; i < output.first + output.count; ++i) {
    const Probe& probe = tables.probes[i];
    const T* const there = s.bodies + probe.neighbour;
    const laws::Spring<T> spring{s.coefficient[probe.stiffness], s.coefficient[probe.damping]};
    force += spring.force(there[0] - here[0], there[S::lanes] - here[S::lanes]);
  }
  for (const PlacedInput& input : s.forces) {
    if (input.place == output.place) {
      force += value[input.index];
    }
  }
  return force / static_cast<T>(program.rate_ratio * program.rate_ratio);
}

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA
