// The steps of the chains kernel in memory, compiled for each instruction set.
#include "core/kernels/chains/chains_loops.h"
#include "core/kernels/passive/passive.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

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
  if (force == 0) {
    return;
  }
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
ChainsLoops<T> loops_for(std::size_t bytes) {
  return with_bytes<vector_bytes(Isa::RESSORT_ISA)>(
      bytes, []<std::size_t pack>() { return ChainsLoops<T>{step<View<T, pack>, T>}; });
}

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA

namespace ressort::kernels {

template <>
ChainsLoops<float> chains_loops<Isa::RESSORT_ISA, float>(std::size_t bytes) {
  return RESSORT_ISA::loops_for<float>(bytes);
}

template <>
ChainsLoops<double> chains_loops<Isa::RESSORT_ISA, double>(std::size_t bytes) {
  return RESSORT_ISA::loops_for<double>(bytes);
}

}  // namespace ressort::kernels
