// The loops of the chorus kernel, compiled for each instruction set.
#include <type_traits>

#include "core/engine/chorus.h"
#include "core/engine/laws.h"
#include "core/engine/twin.h"

namespace ressort::RESSORT_ISA {
namespace {

template <class V>
struct Node {
  V x;
  V v;
  V force;
};

// Calls `use` with 0..N-1 as constants: what they are indices of stays in registers.
template <std::uint32_t N, std::uint32_t I = 0, class Use>
[[gnu::always_inline]] inline void each(Use&& use) {
  if constexpr (I < N) {
    use(std::integral_constant<std::uint32_t, I>{});
    each<N, I + 1>(use);
  }
}

// Copies what the coefficients are now, and what of the laws depends on nothing else.
template <class V>
void fill_slots(const Program& program, const Chorus& chorus, const ChorusTable& table,
                const Scalar<V>* values, std::size_t pack, V* cells) {
  const auto value = [&](std::uint32_t c) {
    return c == chorus_zero ? V{} : reinterpret_cast<const V*>(values)[c * table.packs + pack];
  };
  const std::uint32_t* const slots = table.slots.data();
  for (std::uint32_t i = 0; i < table.first_node; ++i) {
    cells[i] = value(slots[i]);
  }
  const std::uint32_t* const pulls = table.pulls.data();
  for (std::uint32_t i = table.first_pull; i < table.first_link; ++i) {
    cells[i] = value(pulls[i - table.first_pull]);
  }
  V* slot = cells + table.first_link;
  for (const ChorusLinks& links : chorus.links) {
    const LinkRun& run = program.link_runs[links.run];
    for (std::size_t k = 0; k < 5; ++k) {
      slot[k] = value(run.coefficients[k]);
    }
    if (run.law == Law::pluck) {
      const PluckShape<V> shape(slot[0], slot[1]);
      slot[5] = slot[2];
      slot[0] = shape.rise;
      slot[1] = shape.fall;
      slot[2] = shape.inner;
      slot[3] = shape.outer;
      slot[4] = shape.top;
    }
    slot += chorus_link_slots;
  }
}

// Masses and springs held in registers, and what pushes them: a force that had just been added up
// in memory would have to be waited for.
template <class V, std::uint32_t N>
[[gnu::always_inline]] inline void hold(const Chorus& chorus, const ChorusTable& table, V* cells,
                                        const V* value) {
  constexpr std::uint32_t anchors = N + N * (N - 1);
  auto* const node = reinterpret_cast<Node<V>*>(cells + chorus_slots(N, N));
  V x[N];
  V v[N];
  V f[N];
  each<N>([&](auto i) {
    x[i] = node[i].x;
    v[i] = node[i].v;
    f[i] = node[i].force;
    if ((table.pushed >> i & 1) != 0) {
      f[i] += value[table.pusher[i] * table.packs];
    }
  });
  if (table.is_pulled) {
    const V* const pull = cells + table.first_pull;
    each<N>([&](auto i) { f[i] -= pull[3 * i] * x[i] + pull[3 * i + 1] * v[i] + pull[3 * i + 2]; });
  }
  each<N>([&](auto i) {
    v[i] += f[i] * cells[i];
    x[i] += v[i];
    f[i] = V{};
    if ((table.anchored >> i & 1) != 0) {
      const Node<V>& anchor = node[chorus.anchors[i].node];
      f[i] = spring_force(anchor.x - x[i], anchor.v - v[i], cells[anchors + 2 * i],
                          cells[anchors + 2 * i + 1]);
    }
  });
  each<N>([&](auto b) {
    each<b>([&](auto a) {
      constexpr std::uint32_t pair = b * (b - 1) / 2 + a;
      if ((table.linked >> pair & 1) != 0) {
        const V force =
            spring_force(x[a] - x[b], v[a] - v[b], cells[N + 2 * pair], cells[N + 2 * pair + 1]);
        f[a] -= force;
        f[b] += force;
      }
    });
  });
  each<N>([&](auto i) { node[i] = {x[i], v[i], f[i]}; });
}

// The masses alone, however many.
template <class V>
void walk(const ChorusTable& table, V* cells, Node<V>* node) {
  if (table.is_pulled) {
    const V* pull = cells + table.first_pull;
    for (std::uint32_t i = 0; i < table.masses; ++i, pull += 3) {
      node[i].force -= pull[0] * node[i].x + pull[1] * node[i].v + pull[2];
    }
  }
  for (std::uint32_t i = 0; i < table.masses; ++i) {
    node[i].v += node[i].force * cells[i];
    node[i].x += node[i].v;
    node[i].force = V{};
  }
}

template <class V, class ForceLaw>
void add_forces(const std::array<std::uint32_t, 2>* ends, std::uint32_t count, Node<V>* node,
                ForceLaw&& law) {
  for (std::uint32_t i = 0; i < count; ++i) {
    Node<V>& a = node[ends[i][0]];
    Node<V>& b = node[ends[i][1]];
    const V f = law(a.x - b.x, a.v - b.v);
    a.force -= f;
    b.force += f;
  }
}

// What has no inertia gathers forces that nobody asks for.
template <class V>
void step_links(const Program& program, const Chorus& chorus, const V* slot, Node<V>* node) {
  for (const ChorusLinks& links : chorus.links) {
    const auto* const ends = chorus.ends.data() + links.first;
    const auto add = [&](auto&& law) { add_forces(ends, links.count, node, law); };
    const Law law = program.link_runs[links.run].law;
    if (law == Law::pluck) {
      const PluckShape<V> shape(slot);
      const V z = slot[5];
      add([=](V d, V v) { return pluck_force(d, v, shape, z); });
    } else {
      with_law<V>(law, slot[0], slot[1], slot[2], slot[3], slot[4], add);
    }
    slot += chorus_link_slots;
  }
}

// One sample of one pack.
template <class V, std::uint32_t N>
void tick(const Program& program, const Chorus& chorus, const ChorusTable& table, V* cells,
          const V* value, const V* velocity, V* outputs) {
  auto* const node =
      reinterpret_cast<Node<V>*>(cells + (N > 0 ? chorus_slots(N, N) : table.first_node));
  for (std::uint32_t i = 0; i < program.inputs.size(); ++i) {
    const InputSlot& input = program.inputs[i];
    if (!input.is_force) {
      put(value[i * table.packs], node[input.node].x);
      put(velocity[i * table.packs], node[input.node].v);
    } else if (input.node >= N || table.pusher[input.node] != i) {
      node[input.node].force += value[i * table.packs];
    }
  }
  if constexpr (N > 0) {
    hold<V, N>(chorus, table, cells, value);
  } else {
    walk(table, cells, node);
  }
  if (!chorus.links.empty()) {
    step_links(program, chorus, cells + table.first_link, node);
  }
  for (const OutputSlot& output : program.outputs) {
    put(node[output.node].x, *outputs);
    outputs += table.packs;
  }
}

// Returns whether any coefficient moved.
template <class T>
bool move_coefficients(const Program& program, ChorusState<T>& state, const T*& audio) {
  const bool moves = state.ramps.frames > 0 || !program.audio_coefficients.empty();
  advance(state.ramps);
  for (const std::uint32_t c : program.audio_coefficients) {
    for (std::size_t lane = 0; lane < state.ramps.width; ++lane) {
      state.ramps.value[c * state.ramps.width + lane] = *audio++;
    }
  }
  return moves;
}

template <class V, std::uint32_t N>
void step(const Program& program, const Chorus& chorus, const ChorusTable& table,
          ChorusState<Scalar<V>>& state, const Block<Scalar<V>>& block) {
  const auto* value = reinterpret_cast<const V*>(block.value);
  const auto* velocity = reinterpret_cast<const V*>(block.velocity);
  auto* outputs = reinterpret_cast<V*>(block.outputs);
  auto* const cells = reinterpret_cast<V*>(state.cells);
  const auto* audio = block.audio;
  const std::size_t packs = table.packs;
  for (std::size_t frame = 0; frame < block.frames; ++frame) {
    if (move_coefficients(program, state, audio) || frame == 0) {
      for (std::size_t pack = 0; pack < packs; ++pack) {
        fill_slots<V>(program, chorus, table, state.ramps.value, pack, cells + pack * table.cells);
      }
    }
    for (std::size_t pack = 0; pack < packs; ++pack) {
      tick<V, N>(program, chorus, table, cells + pack * table.cells, value + pack, velocity + pack,
                 outputs + pack);
    }
    value += program.inputs.size() * packs;
    velocity += program.inputs.size() * packs;
    outputs += program.outputs.size() * packs;
  }
}

template <class V>
ChorusStep<Scalar<V>> step_for(std::uint32_t held) {
  switch (held) {
    case 1:
      return step<V, 1>;
    case 2:
      return step<V, 2>;
    case 3:
      return step<V, 3>;
    case 4:
      return step<V, 4>;
    default:
      return step<V, 0>;
  }
}

template <class T>
ChorusStep<T> step_in(std::uint32_t held, std::size_t bytes) {
  if constexpr (vector_bytes(Isa::RESSORT_ISA) >= 64) {
    if (bytes == 128) {
      return step_for<Twin<Pack<T, 64>>>(held);
    }
    if (bytes == 64) {
      return step_for<Pack<T, 64>>(held);
    }
  }
  if constexpr (vector_bytes(Isa::RESSORT_ISA) >= 32) {
    if (bytes == 32) {
      return step_for<Pack<T, 32>>(held);
    }
  }
  return step_for<Pack<T, 16>>(held);
}

}  // namespace
}  // namespace ressort::RESSORT_ISA

namespace ressort {

template <>
ChorusStep<float> chorus_step<Isa::RESSORT_ISA, float>(std::uint32_t held, std::size_t bytes) {
  return RESSORT_ISA::step_in<float>(held, bytes);
}

template <>
ChorusStep<double> chorus_step<Isa::RESSORT_ISA, double>(std::uint32_t held, std::size_t bytes) {
  return RESSORT_ISA::step_in<double>(held, bytes);
}

}  // namespace ressort
