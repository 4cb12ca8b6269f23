// The loops of the chains' kernel, compiled for each instruction set.
#include <utility>

#include "core/engine/chains.h"
#include "core/engine/laws.h"

namespace ressort::RESSORT_ISA {
namespace {

template <class T, std::size_t Bytes>
struct View {
  using V = Pack<T, Bytes>;
  static constexpr std::uint32_t lanes = Bytes / sizeof(T);

  explicit View(ChainsState<T>& state)
      : pair(reinterpret_cast<V*>(state.bodies)),
        bodies(state.bodies),
        held(state.held),
        force(state.force),
        coefficient(state.ramps.value) {
    for (std::uint32_t i = 0; i < lanes; ++i) {
      lane[i] = static_cast<T>(i);
    }
  }

  V* pair;    // positions at 2 i, velocities at 2 i + 1
  T* bodies;  // the same
  V lane;     // 0, 1, 2...
  T* held;
  T* force;
  const T* coefficient;
};

// Lane i is lane i - 1 of y; the first is that of `first`.
template <class V, std::size_t... I>
V up(V first, V y, std::index_sequence<I...>) {
  return __builtin_shufflevector(first, y, 0, (sizeof...(I) + 1 + I)...);
}
// Lane i is lane i + 1 of y.
template <class V, std::size_t... I>
V down(V y, std::index_sequence<I...>) {
  return __builtin_shufflevector(y, y, (I + 1)..., sizeof...(I));
}

// What the springs make of one chain's masses; `pull` is what acts on one besides.
template <class S, class Pull>
void move_chain(const FoldedChain& chain, S& s, const typename S::V k, const typename S::V z,
                Pull&& pull) {
  using V = typename S::V;
  using T = Element<V>;
  const auto others = std::make_index_sequence<S::lanes - 1>{};
  V* const pair = s.pair + 2 * chain.first;
  const auto tension = [=](std::uint32_t j) { return k * pair[2 * j] + z * pair[2 * j + 1]; };
  // A free end is next to one that moves with it.
  const auto end = [&](Place place, V itself) {
    return place == nowhere ? itself : k * s.bodies[place] + z * s.bodies[place + S::lanes];
  };
  const V first = tension(0);
  V y = first;
  V before = y - up(end(chain.left, first), tension(chain.packs - 1), others);
  const auto move = [&](std::uint32_t j, V next, V inverse_mass) {
    V& x = pair[2 * j];
    V& v = pair[2 * j + 1];
    const V after = next - y;
    v += (after - before - pull(x, v)) * inverse_mass;
    x += v;
    before = after;
    y = next;
  };
  // Lanes behind the last mass are empty and stay so: their mass is infinite.
  const V limit = V{} + static_cast<T>(chain.last_lane);
  const V inverse_mass = V{} + s.coefficient[chain.mass.inverse_mass];
  const V within = select(s.lane <= limit, inverse_mass, V{});
  const V beyond = select(s.lane < limit, inverse_mass, V{});
  for (std::uint32_t j = 0; j < chain.last; ++j) {
    move(j, tension(j + 1), within);
  }
  const bool is_full = chain.last + 1 == chain.packs;
  const V next = is_full ? down(first, others) : tension(chain.last + 1);
  move(chain.last, select(s.lane == limit, end(chain.right, y), next), within);
  if (!is_full) {
    for (std::uint32_t j = chain.last + 1; j + 1 < chain.packs; ++j) {
      move(j, tension(j + 1), beyond);
    }
    move(chain.packs - 1, down(first, others), beyond);
  }
}

template <class S>
void step_chains(const ChainsTables& tables, S& s) {
  using V = typename S::V;
  const FoldedChain* const chains = tables.chains.data();
  for (std::size_t i = 0; i < tables.chains.size(); ++i) {
    const FoldedChain& chain = chains[i];
    const V k = V{} + s.held[2 * i];
    const V z = V{} + s.held[2 * i + 1];
    if (chain.mass.is_oscillator || chain.mass.has_gravity) {
      const bool pulls = chain.mass.is_oscillator;
      const V own_k = V{} + (pulls ? s.coefficient[chain.mass.stiffness] : 0);
      const V own_z = V{} + (pulls ? s.coefficient[chain.mass.damping] : 0);
      const V g = V{} + (chain.mass.has_gravity ? s.coefficient[chain.mass.gravity] : 0);
      move_chain(chain, s, k, z, [=](V x, V v) { return own_k * x + own_z * v + g; });
    } else {
      move_chain(chain, s, k, z, [](V, V) { return V{}; });
    }
  }
}

// In whole packs: the next pass could not load a pack soon of which a part has just been written.
template <class S>
void push_sites(const ChainsTables& tables, S& s) {
  using V = typename S::V;
  using T = Element<V>;
  const ChainSite* const sites = tables.sites.data();
  for (std::size_t i = 0; i < tables.sites.size(); ++i) {
    const Place place = sites[i].place;
    V* const pair = s.pair + place / (2 * S::lanes) * 2;
    const V push = V{} + s.force[i] * s.coefficient[sites[i].inverse_mass];
    const V change = select(s.lane == V{} + static_cast<T>(place % S::lanes), push, V{});
    pair[0] += change;
    pair[1] += change;
    s.force[i] = 0;
  }
}

template <class S>
void step_loose(const ChainsTables& tables, S& s) {
  using T = Element<typename S::V>;
  T* const force = s.force + tables.sites.size();
  const Place* const loose = tables.loose.data();
  const LoosePlaces* const runs = tables.loose_runs.data();
  for (std::size_t r = 0; r < tables.loose_runs.size(); ++r) {
    const MassRun& mass = runs[r].mass;
    const T inverse_mass = s.coefficient[mass.inverse_mass];
    const T k = mass.is_oscillator ? s.coefficient[mass.stiffness] : 0;
    const T z = mass.is_oscillator ? s.coefficient[mass.damping] : 0;
    const T g = mass.has_gravity ? s.coefficient[mass.gravity] : 0;
    for (std::uint32_t i = runs[r].first; i < runs[r].first + runs[r].count; ++i) {
      T& x = s.bodies[loose[i]];
      T& v = s.bodies[loose[i] + S::lanes];
      v += (force[i] - k * x - z * v - g) * inverse_mass;
      x += v;
      force[i] = 0;
    }
  }
  for (std::size_t i = tables.sites.size() + tables.loose.size(); i < tables.forces; ++i) {
    s.force[i] = 0;
  }
}

template <class S>
void step_links(const ChainsTables& tables, S& s) {
  using T = Element<typename S::V>;
  const LinkRun* const runs = tables.link_runs.data();
  for (std::size_t r = 0; r < tables.link_runs.size(); ++r) {
    const LinkRun& run = runs[r];
    const auto c = [&](std::size_t i) { return s.coefficient[run.coefficients[i]]; };
    with_law<T>(run.law, c(0), c(1), c(2), c(3), c(4), [&](auto&& law) {
      const PlacedEnds* const ends = tables.ends.data() + run.first;
      for (std::uint32_t i = 0; i < run.count; ++i) {
        const auto [a, b, force_a, force_b] = ends[i];
        const T f = law(s.bodies[a] - s.bodies[b], s.bodies[a + S::lanes] - s.bodies[b + S::lanes]);
        s.force[force_a] -= f;
        s.force[force_b] += f;
      }
    });
  }
}

template <class S, class T>
T read_output(const Program& program, const ChainsTables& tables, const S& s, const T* value,
              const PlacedOutput& output) {
  const T x = s.bodies[output.place];
  if (!output.is_force) {
    return x;
  }
  const T v = s.bodies[output.place + S::lanes];
  T force = s.force[output.force];
  for (std::uint32_t i = output.first; i < output.first + output.count; ++i) {
    const Probe& probe = tables.probes[i];
    force += spring_force(s.bodies[probe.neighbour] - x, s.bodies[probe.neighbour + S::lanes] - v,
                          s.coefficient[probe.stiffness], s.coefficient[probe.damping]);
  }
  for (std::size_t i = 0; i < tables.inputs.size(); ++i) {
    if (tables.inputs[i].is_force && tables.inputs[i].place == output.place) {
      force += value[i];
    }
  }
  return force / static_cast<T>(program.rate_ratio * program.rate_ratio);
}

template <class T, std::size_t Bytes>
void step(const Program& program, const ChainsTables& tables, ChainsState<T>& state,
          const Block<T>& block) {
  View<T, Bytes> s(state);
  const T* value = block.value;
  const T* velocity = block.velocity;
  const T* audio = block.audio;
  T* outputs = block.outputs;
  const std::size_t inputs = tables.inputs.size();
  for (std::size_t frame = 0; frame < block.frames; ++frame) {
    advance(state.ramps);
    for (const std::uint32_t c : program.audio_coefficients) {
      state.ramps.value[c] = *audio++;
    }
    for (std::size_t i = 0; i < inputs; ++i) {
      if (tables.inputs[i].is_force) {
        s.force[tables.inputs[i].force] += value[i];
      }
    }
    step_chains(tables, s);
    push_sites(tables, s);
    step_loose(tables, s);
    for (std::size_t i = 0; i < inputs; ++i) {
      if (!tables.inputs[i].is_force) {
        s.bodies[tables.inputs[i].place] = value[i];
        s.bodies[tables.inputs[i].place + View<T, Bytes>::lanes] = velocity[i];
      }
    }
    step_links(tables, s);
    for (std::size_t i = 0; i < tables.chains.size(); ++i) {
      s.held[2 * i] = s.coefficient[tables.chains[i].stiffness];
      s.held[2 * i + 1] = s.coefficient[tables.chains[i].damping];
    }
    for (const PlacedOutput& output : tables.outputs) {
      *outputs++ = read_output(program, tables, s, value, output);
    }
    value += inputs;
    velocity += inputs;
  }
}

}  // namespace

template <class T>
ChainsStep<T> chains_step(std::size_t bytes) {
  if constexpr (RESSORT_VECTOR_BYTES >= 64) {
    if (bytes == 64) {
      return step<T, 64>;
    }
  }
  if constexpr (RESSORT_VECTOR_BYTES >= 32) {
    if (bytes == 32) {
      return step<T, 32>;
    }
  }
  return step<T, 16>;
}

template ChainsStep<float> chains_step(std::size_t);
template ChainsStep<double> chains_step(std::size_t);

}  // namespace ressort::RESSORT_ISA
