// The steps of the chains kernel, compiled for each instruction set.
#include <algorithm>
#include <limits>
#include <utility>

#include "core/kernels/chains/chains.h"
#include "core/kernels/passive/passive.h"
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

// Moves one chain's masses by their springs (symplectic Euler); `pull` adds the masses' own springs
// and gravity.
template <class S, class Pull>
void move_chain(const FoldedChain& chain, const typename S::Number* masks,
                const typename S::Number* held, S& s, Pull&& pull) {
  using V = typename S::V;
  const auto others = std::make_index_sequence<S::lanes - 1>{};
  V* const begin = &pack_at<V>(s.bodies + chain.first);
  V* const last = begin + 2 * chain.last;
  V* const back = begin + 2 * (chain.packs - 1);
  const V k = all<V>(held[0]);
  const V z = all<V>(held[1]);
  const auto tension = [=](const V* pair) { return k * pair[0] + z * pair[1]; };
  const auto end = [&](ChainPlace place, V itself) { return tension_of(place, held, itself, s); };
  const V first = tension(begin);
  V y = first;
  V before = y - up(end(chain.left, first), tension(back), others);
  const auto move = [&](V* pair, V next, V inverse_mass) {
    const V after = next - y;
    const V v = pair[1] + (after - before - pull(pair[0], pair[1])) * inverse_mass;
    pair[1] = v;
    pair[0] += v;
    before = after;
    y = next;
  };
  const auto move_until = [&](V* pair, const V* stop, V inverse_mass) {
    for (; stop - pair >= 8; pair += 8) {
      move(pair, tension(pair + 2), inverse_mass);
      move(pair + 2, tension(pair + 4), inverse_mass);
      move(pair + 4, tension(pair + 6), inverse_mass);
      move(pair + 6, tension(pair + 8), inverse_mass);
    }
    for (; pair != stop; pair += 2) {
      move(pair, tension(pair + 2), inverse_mass);
    }
  };
  // Lanes after the last mass stay empty: their inverse mass is 0.
  const V inverse_mass = all<V>(s.coefficient[chain.mass.inverse_mass]);
  const V within = inverse_mass * pack_at<V>(masks);
  const V beyond = inverse_mass * pack_at<V>(masks + S::lanes);
  move_until(begin, last, within);
  const V next = last == back ? down(first, first, others) : tension(last + 2);
  const auto is_last = pack_at<V>(masks + 2 * S::lanes) > V{};
  move(last, select(is_last, end(chain.right, y), next), within);
  if (last != back) {
    move_until(last + 2, back, beyond);
    move(back, down(first, first, others), beyond);
  }
}

// Does the same for a stiff chain. Not inlined, with a copy of the view, so that the caller's view
// stays in registers, where stores into packs cannot change it.
template <class S, class Pull>
[[gnu::noinline]] void move_stiff_chain(const FoldedChain& chain, const typename S::Number* masks,
                                        const typename S::Number* held, S s, Pull&& pull) {
  using V = typename S::V;
  struct Tension {
    V near;
    V far;
  };
  const auto others = std::make_index_sequence<S::lanes - 1>{};
  V* const begin = &pack_at<V>(s.bodies + chain.first);
  V* const last = begin + 2 * chain.last;
  V* const back = begin + 2 * (chain.packs - 1);
  V* const last_but_one = last == begin ? back : last - 2;
  const V k = all<V>(held[0]);
  const V z = all<V>(held[1]);
  const V far_k = all<V>(held[2]);
  const V far_z = all<V>(held[3]);
  const auto tension = [=](const V* pair) {
    return Tension{k * pair[0] + z * pair[1], far_k * pair[0] + far_z * pair[1]};
  };
  const auto far_end = [&](ChainPlace place, V itself) {
    return tension_of(place, held + 2, itself, s);
  };
  const Tension first = tension(begin);
  const Tension second = tension(begin + 2);
  const Tension below = tension(back);
  Tension here = first;
  Tension next = second;
  V before = here.near - up(tension_of(chain.left, held, here.near, s), below.near, others);
  V far_before =
      here.far - up(far_end(chain.second_left[0], here.far), tension(back - 2).far, others);
  V far_between = next.far - up(far_end(chain.second_left[1], next.far), below.far, others);
  const auto move = [&](V* pair, V near, Tension ahead, V far, V inverse_mass) {
    const V after = near - here.near;
    const V far_after = far - here.far;
    const V force = after - before + (far_after - far_before);
    const V v = pair[1] + (force - pull(pair[0], pair[1])) * inverse_mass;
    pair[1] = v;
    pair[0] += v;
    before = after;
    far_before = far_between;
    far_between = far_after;
    here = next;
    next = ahead;
  };
  const V inverse_mass = all<V>(s.coefficient[chain.mass.inverse_mass]);
  const V within = inverse_mass * pack_at<V>(masks);
  const V beyond = inverse_mass * pack_at<V>(masks + S::lanes);
  const auto is_last = pack_at<V>(masks + 2 * S::lanes) > V{};
  const auto is_last_but_one = pack_at<V>(masks + 3 * S::lanes) > V{};
  V* pair = begin;
  for (V* const stop = last == begin ? begin : last - 2; pair != stop; pair += 2) {
    const Tension ahead = tension(pair + 4);
    move(pair, next.near, ahead, ahead.far, within);
  }
  for (; pair <= back; pair += 2) {
    const Tension& turned = pair == back ? second : first;
    const Tension ahead = pair < back - 2 ? tension(pair + 4)
                                          : Tension{down(turned.near, turned.near, others),
                                                    down(turned.far, turned.far, others)};
    V near = next.near;
    V far = ahead.far;
    if (pair == last_but_one) {
      far = select(is_last_but_one, far_end(chain.second_right[1], here.far), far);
    }
    if (pair == last) {
      near = select(is_last, tension_of(chain.right, held, here.near, s), near);
      far = select(is_last, far_end(chain.second_right[0], here.far), far);
    }
    move(pair, near, ahead, far, pair <= last ? within : beyond);
  }
}

template <class S, class Pull>
void move_any_chain(const FoldedChain& chain, const typename S::Number* masks,
                    const typename S::Number* held, S& s, Pull&& pull) {
  if (chain.is_stiff) {
    move_stiff_chain(chain, masks, held, s, pull);
  } else {
    move_chain(chain, masks, held, s, pull);
  }
}

template <class S>
void step_chains(S& s) {
  using V = typename S::V;
  const auto* held = s.held;
  const auto* masks = s.masks;
  for (const FoldedChain& chain : s.chains) {
    if (chain.mass.is_oscillator || chain.mass.has_gravity) {
      const bool pulls = chain.mass.is_oscillator;
      const V own_k = all<V>(pulls ? s.coefficient[chain.mass.stiffness] : 0);
      const V own_z = all<V>(pulls ? s.coefficient[chain.mass.damping] : 0);
      const V g = all<V>(chain.mass.has_gravity ? s.coefficient[chain.mass.gravity] : 0);
      move_any_chain(chain, masks, held, s, [=](V x, V v) { return own_k * x + own_z * v + g; });
    } else {
      move_any_chain(chain, masks, held, s, [](V, V) { return V{}; });
    }
    held += 4;
    masks += 4 * S::lanes;
  }
}

// Writes a whole pack: a partial store would delay the next pass, which loads the pack (store
// forwarding).
template <class S>
void push(const ChainSite& site, typename S::Number force, S& s) {
  using V = typename S::V;
  const V change =
      all<V>(force * s.coefficient[site.inverse_mass]) * pack_at<V>(s.units + site.unit);
  V* const pair = &pack_at<V>(s.bodies + site.pair);
  pair[0] += change;
  pair[1] += change;
}

template <class S>
void push_sites(S& s) {
  auto* force = s.force;
  for (const ChainSite& site : s.sites) {
    if (*force != 0) {
      push(site, *force, s);
      *force = 0;
    }
    ++force;
  }
}

// Distributes the force on a point to the nodes around it.
template <class S, class T>
void spread(const Corners<T>& corners, T force, S s) {
  each_corner(corners, [&](std::uint32_t corner, T weight) {
    const PlacedNode& node = s.tap_nodes[corner];
    if (node.force != nowhere) {
      s.force[node.force] += weight * force;
    } else {
      push(node.site, weight * force, s);
    }
  });
}

// Links act where a point was in the last sample, inputs where it is in this one.
template <class S>
void push_taps(S& s) {
  auto* corners = s.corners;
  auto* pull = s.tap_pull;
  for (const PlacedTap& tap : s.taps) {
    spread(*corners, *pull++, s);
    *corners = corners_at(tap.slot, s.coefficient[tap.slot.u], s.coefficient[tap.slot.v]);
    spread(*corners, s.force[tap.force], s);
    s.force[tap.force] = 0;
    ++corners;
  }
}

// A point moves with the nodes around it, and along them when its coordinate changes.
template <class S>
void move_taps(S& s) {
  const auto* corners = s.corners;
  for (const PlacedTap& tap : s.taps) {
    typename S::Number position = 0;
    each_corner(*corners++, [&](std::uint32_t corner, auto weight) {
      position += weight * s.bodies[s.tap_nodes[corner].place];
    });
    s.bodies[tap.place + S::lanes] = position - s.bodies[tap.place];
    s.bodies[tap.place] = position;
  }
}

template <class S>
void pull_taps(S& s) {
  auto* pull = s.tap_pull;
  for (const PlacedTap& tap : s.taps) {
    *pull++ = s.force[tap.force];
    s.force[tap.force] = 0;
  }
}

// Computes the forces that act in the next sample.
template <class S>
void pull(S& s) {
  step_links(s);
  pull_taps(s);
  auto* held = s.held;
  for (const FoldedChain& chain : s.chains) {
    for (const std::uint32_t c : chain.springs) {
      *held++ = s.coefficient[c];
    }
  }
}

// Passive links, one by one.
template <class S>
struct Passive {
  using T = typename S::Number;
  using V = typename S::V;

  CoefficientView<T> coefficients() const { return {s.coefficient}; }
  T awake() const { return *state.awake; }
  T distance_now(Ends ends) const { return body(ends.a)[0] - body(ends.b)[0]; }
  T speed_now(Ends ends) const { return body(ends.a)[S::lanes] - body(ends.b)[S::lanes]; }
  T distance(Ends ends) const { return distance_now(ends); }
  T speed(Ends ends) const { return speed_now(ends); }
  T gamma(Ends ends) const { return ends.a == ends.b ? T(0) : give(ends.a) + give(ends.b); }
  void push(Ends ends, T force) {
    shift(ends.a, give(ends.a) * -force);
    shift(ends.b, give(ends.b) * force);
  }
  void add_reaction(std::uint32_t, T) {}

  const T* body(std::uint32_t end) const { return s.bodies + tables.passive_ends[end].place; }
  T give(std::uint32_t end) const {
    const std::uint32_t mass = tables.passive_ends[end].inverse_mass;
    return mass == nowhere ? T(0) : s.coefficient[mass];
  }
  // Writes whole packs in a chain, as push() does.
  void shift(std::uint32_t index, T way) {
    const PassiveEnd& end = tables.passive_ends[index];
    if (end.unit == nowhere) {
      s.bodies[end.place] += way;
      s.bodies[end.place + S::lanes] += way;
      return;
    }
    const V unit = pack_at<V>(s.units + end.unit);
    V* const pair = &pack_at<V>(s.bodies + (end.place - end.unit / S::lanes));
    pair[0] += all<V>(way) * unit;
    pair[1] += all<V>(way) * unit;
  }

  const ChainsTables& tables;
  ChainsState<T>& state;
  S s;
};

// Uses a view of its own, because it would cost step() registers.
template <class S, class T>
[[gnu::noinline]] void remember_links(const ChainsTables& tables, ChainsState<T>& state) {
  remember(state.passive, state.memory, Passive<S>{tables, state, S(tables, state)});
}
template <class S, class T>
[[gnu::noinline]] void correct_links(const ChainsTables& tables, ChainsState<T>& state) {
  Passive<S> body{tables, state, S(tables, state)};
  correct(state.passive, state.memory, state.solver, body);
  *state.awake = 1;
}

template <class S, class T>
void step(const Program& program, const ChainsTables& tables, ChainsState<T>& state,
          const Block<T>& block) {
  S s(tables, state);
  Ramps<T> ramps = state.ramps;
  const Table<std::uint32_t> audio_coefficients(program.audio_coefficients);
  const T* value = block.value;
  const T* velocity = block.velocity;
  const T* audio = block.audio;
  T* outputs = block.outputs;
  const std::size_t inputs = program.inputs.size();
  const std::size_t output_count = program.outputs.size();
  const std::size_t frames = block.frames;
  const bool has_passive = !state.passive.links.empty();
  for (std::size_t frame = 0; frame < frames; ++frame) {
    advance(ramps);
    for (const std::uint32_t c : audio_coefficients) {
      ramps.value[c] = *audio++;
    }
    if (has_passive) {
      remember_links<S>(tables, state);
    }
    for (const PlacedInput& input : s.forces) {
      s.force[input.force] += value[input.index];
    }
    step_chains(s);
    push_sites(s);
    push_taps(s);
    step_loose(s);
    for (const PlacedInput& input : s.positions) {
      s.bodies[input.place] = value[input.index];
      s.bodies[input.place + S::lanes] = velocity[input.index];
    }
    if (has_passive) {
      correct_links<S>(tables, state);
    }
    move_taps(s);
    for (const std::uint32_t i : s.listened) {
      s.force[i] = 0;
    }
    pull(s);
    for (const HeardPosition& output : s.heard_positions) {
      outputs[output.index] = s.bodies[output.place];
    }
    for (const HeardForce& output : s.heard_forces) {
      outputs[output.index] = force_at(program, tables, s, value, output);
    }
    outputs += output_count;
    value += inputs;
    velocity += inputs;
  }
}

template <class T>
ChainsStep<T> step_for(std::size_t bytes) {
  return with_bytes<vector_bytes(Isa::RESSORT_ISA)>(
      bytes, []<std::size_t pack>() -> ChainsStep<T> { return step<View<T, pack>, T>; });
}

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA

namespace ressort::kernels {

template <>
ChainsStep<float> chains_step<Isa::RESSORT_ISA, float>(std::size_t bytes) {
  return RESSORT_ISA::step_for<float>(bytes);
}

template <>
ChainsStep<double> chains_step<Isa::RESSORT_ISA, double>(std::size_t bytes) {
  return RESSORT_ISA::step_for<double>(bytes);
}

}  // namespace ressort::kernels
