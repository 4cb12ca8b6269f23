// The loops of the batch kernel, compiled for each instruction set.
#include <type_traits>

#include "core/kernels/batch/batch.h"
#include "core/laws/laws.h"

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

// A law that a kernel may keep as numbers that follow from its arguments.
template <class ForceLaw, class V>
concept Kept = requires(const ForceLaw& law, V* row) {
  law.keep(row);
};

// The law of a link's slots.
template <class V, class Type>
[[gnu::always_inline]] inline auto law_in(const V* slot) {
  using ForceLaw = typename Type::template With<V>;
  if constexpr (Kept<ForceLaw, V>) {
    return ForceLaw(slot);
  } else {
    return law_of<Type, V>([&](std::size_t i) { return slot[i]; });
  }
}

// All packs, for what is done to each of them in turn.
template <class V>
struct Packs {
  Packs(const BatchTable& table, void* memory)
      : count(table.packs),
        stride(table.cells),
        cells(static_cast<V*>(memory)),
        slots(cells + batch_node_cells * table.nodes) {}

  Node<V>* nodes(std::size_t pack) const {
    return reinterpret_cast<Node<V>*>(cells + pack * stride);
  }

  std::size_t count;
  std::size_t stride;
  V* cells;
  V* slots;
};

// Where a block is in the rows of all voices.
template <class V>
struct Rows {
  Rows(const Program& program, const BatchTable& table, const auto& block)
      : value(reinterpret_cast<const V*>(block.value)),
        velocity(reinterpret_cast<const V*>(block.velocity)),
        outputs(reinterpret_cast<V*>(block.outputs)),
        in(program.inputs.size() * table.packs),
        out(program.outputs.size() * table.packs) {}

  void advance() {
    value += in;
    velocity += in;
    outputs += out;
  }

  const V* value;
  const V* velocity;
  V* outputs;
  std::size_t in;
  std::size_t out;
};

// Returns whether any coefficient moved.
template <class T>
bool move_coefficients(const Program& program, Ramps<T>& ramps, const T*& audio) {
  const bool moves = ramps.frames > 0 || !program.audio_coefficients.empty();
  advance(ramps);
  for (const std::uint32_t c : program.audio_coefficients) {
    for (std::size_t lane = 0; lane < ramps.width; ++lane) {
      ramps.value[c * ramps.width + lane] = *audio++;
    }
  }
  return moves;
}

// Copies what the coefficients are now, and what of the laws follows from them alone.
template <class V>
void fill_slots(const BatchTable& table, const V* coefficients, const Packs<V>& packs) {
  for (const BatchTable::Copy copy : table.copies) {
    const V* const from = coefficients + copy.coefficient * packs.count;
    V* to = packs.slots + copy.slot;
    for (std::size_t pack = 0; pack < packs.count; ++pack, to += packs.stride) {
      *to = from[pack];
    }
  }
  V* slots = packs.slots + table.first_link;
  for (const Law law : table.laws) {
    V* slot = slots;
    for (std::size_t pack = 0; pack < packs.count; ++pack, slot += packs.stride) {
      with_law_type(law, [&]<class Type>(Type) {
        if constexpr (Kept<typename Type::template With<V>, V>) {
          law_of<Type, V>([&](std::size_t i) { return slot[i]; }).keep(slot);
        }
      });
    }
    slots += batch_link_slots;
  }
}

template <class V>
void take_positions(const Program& program, const Packs<V>& packs, const Rows<V>& rows) {
  const V* value = rows.value;
  const V* velocity = rows.velocity;
  for (const InputSlot& input : program.inputs) {
    for (std::size_t pack = 0; pack < packs.count && !input.is_force; ++pack) {
      Node<V>& node = packs.nodes(pack)[input.node];
      node.x = value[pack];
      node.v = velocity[pack];
    }
    value += packs.count;
    velocity += packs.count;
  }
}

template <class V>
void take_force(std::uint32_t node, const Packs<V>& packs, const V* value) {
  for (std::size_t pack = 0; pack < packs.count; ++pack) {
    packs.nodes(pack)[node].force += value[pack];
  }
}

template <class V>
void give_positions(const Program& program, const Packs<V>& packs, V* outputs) {
  for (const OutputSlot& output : program.outputs) {
    for (std::size_t pack = 0; pack < packs.count; ++pack) {
      outputs[pack] = packs.nodes(pack)[output.node].x;
    }
    outputs += packs.count;
  }
}

// Adds what a link exerts to the masses' forces.
template <class V, class Type>
[[gnu::always_inline]] inline void link(const Packs<V>& packs, const V* slot, std::uint32_t a,
                                        std::uint32_t b, std::uint32_t masses) {
  for (std::size_t pack = 0; pack < packs.count; ++pack, slot += packs.stride) {
    Node<V>* const nodes = packs.nodes(pack);
    const V force = law_in<V, Type>(slot).force(nodes[a].x - nodes[b].x, nodes[a].v - nodes[b].v);
    if (a < masses) {
      nodes[a].force -= force;
    }
    if (b < masses) {
      nodes[b].force += force;
    }
  }
}

// --- links that are not plain --------------------------------------------------------------------

// Those of one pack.
template <class V>
struct Passive {
  V coefficient(std::uint32_t c) const { return coefficients[c * packs]; }
  V awake() const { return is_awake; }
  V distance_now(Ends ends) const { return nodes[ends.a].x - nodes[ends.b].x; }
  V speed_now(Ends ends) const { return nodes[ends.a].v - nodes[ends.b].v; }
  V distance(Ends ends) const { return distance_now(ends); }
  V speed(Ends ends) const { return speed_now(ends); }
  V gamma(Ends ends) const { return ends.a == ends.b ? V{} : give(ends.a) + give(ends.b); }
  void push(Ends ends, V force) {
    push_node(ends.a, -force);
    push_node(ends.b, force);
  }
  void shift(std::uint32_t node, V way) {
    nodes[node].x += way;
    nodes[node].v += way;
  }
  void feel(std::uint32_t, V) {}

  V give(std::uint32_t node) const { return node < masses ? coefficient(inverse_mass[node]) : V{}; }
  void push_node(std::uint32_t node, V force) {
    if (node < masses) {
      shift(node, give(node) * force);
    }
  }

  Node<V>* nodes;
  const V* coefficients;  // of the pack; the next is as many further as there are packs
  std::size_t packs;
  const std::uint32_t* inverse_mass;
  std::uint32_t masses;
  V is_awake;
};

template <class V, class T>
class PassiveLinks {
 public:
  PassiveLinks(const Program& program, const Packs<V>& packs, BatchState<T>& state)
      : program_(program), packs_(packs), state_(state), is_any_(!state.passive.links.empty()) {}

  void remember() const {
    if (is_any_) {
      remember_all();
    }
  }
  void correct() const {
    if (is_any_) {
      correct_all();
    }
  }

 private:
  Passive<V> body(std::size_t pack) const {
    return {.nodes = packs_.nodes(pack),
            .coefficients = reinterpret_cast<const V*>(state_.ramps.value) + pack,
            .packs = packs_.count,
            .inverse_mass = state_.inverse_mass,
            .masses = program_.moving,
            .is_awake = reinterpret_cast<const V*>(state_.awake)[pack]};
  }
  V* memory(std::size_t pack) const {
    return reinterpret_cast<V*>(state_.memory) + pack * passive_rows * state_.passive.links.size();
  }

  [[gnu::noinline]] void remember_all() const {
    for (std::size_t pack = 0; pack < packs_.count; ++pack) {
      ressort::remember(state_.passive, memory(pack), body(pack));
    }
  }
  [[gnu::noinline]] void correct_all() const {
    for (std::size_t pack = 0; pack < packs_.count; ++pack) {
      Passive<V> own = body(pack);
      ressort::correct(state_.passive, memory(pack), reinterpret_cast<V*>(state_.solver), own);
      reinterpret_cast<V*>(state_.awake)[pack] = V{} + 1;
    }
  }

  const Program& program_;
  const Packs<V>& packs_;
  BatchState<T>& state_;
  bool is_any_;
};

// --- masses in registers -------------------------------------------------------------------------

// A sample's step in two halves: the springs exert their forces, and the masses move by them. In a
// block the second half of one sample and the first of the one before are taken together, so that
// the forces never leave the registers; only those of a block's last sample wait for the next.
enum class Half { move, exert, exert_and_move };

template <class V, std::uint32_t N, bool is_alike>
class Holder {
 public:
  Holder(const Program& program, const Batch& batch, const BatchTable& table, const Packs<V>& packs)
      : program_(program), batch_(batch), table_(table), packs_(packs) {
    each<N>([&](auto i) {
      anchor_[i] = batch.anchors[i].node;
      pusher_[i] = table.pusher[i] * packs.count;
    });
  }

  void move(const V* value) const {
    push_again(value);
    pass<Half::move>(value);
  }
  void exert() const {
    exert_links();
    pass<Half::exert>(nullptr);
  }
  void exert_and_move(const V* value) const {
    exert_links();
    push_again(value);
    pass<Half::exert_and_move>(value);
  }

 private:
  static constexpr std::uint32_t pairs = N;  // slots
  static constexpr std::uint32_t anchors = pairs + N * (N - 1);
  static constexpr std::uint32_t pulls = anchors + 2 * N;

  template <Half half>
  [[gnu::always_inline]] void pass(const V* value) const {
    const std::uint32_t touched = table_.touched;
    const std::uint32_t anchored = table_.anchored;
    const std::uint32_t linked = table_.linked;
    const std::uint32_t pushed = table_.pushed;
    const bool is_pulled = table_.is_pulled;
    const V* slot = packs_.slots;
    for (std::size_t pack = 0; pack < packs_.count; ++pack, slot += packs_.stride) {
      Node<V>* const nodes = packs_.nodes(pack);
      V x[N];
      V v[N];
      V f[N];
      each<N>([&](auto i) {
        x[i] = nodes[i].x;
        v[i] = nodes[i].v;
        f[i] = V{};
        if (half == Half::move || (touched & 1u << i) != 0) {
          f[i] = nodes[i].force;
          nodes[i].force = V{};
        }
      });
      if constexpr (half != Half::move) {
        exert_springs(nodes, slot, anchored, linked, x, v, f);
      }
      if constexpr (half == Half::exert) {
        each<N>([&](auto i) { nodes[i].force = f[i]; });
        continue;
      }
      each<N>([&](auto i) {
        if ((pushed & 1u << i) != 0) {
          f[i] += value[pusher_[i] + pack];
        }
      });
      if (is_pulled) {
        const V* const pull = slot + pulls;
        each<N>(
            [&](auto i) { f[i] -= pull[3 * i] * x[i] + pull[3 * i + 1] * v[i] + pull[3 * i + 2]; });
      }
      each<N>([&](auto i) {
        v[i] += f[i] * slot[is_alike ? 0 : i()];
        x[i] += v[i];
        nodes[i].x = x[i];
        nodes[i].v = v[i];
      });
    }
  }

  // Among three masses the springs that there are not are computed too, from zeros.
  [[gnu::always_inline]] void exert_springs(const Node<V>* nodes, const V* slot,
                                            std::uint32_t anchored, std::uint32_t linked,
                                            const V (&x)[N], const V (&v)[N], V (&f)[N]) const {
    each<N>([&](auto i) {
      if ((anchored & 1u << i) != 0) {
        const Node<V>& anchor = nodes[anchor_[i]];
        const V* const own = slot + anchors + 2 * i;
        f[i] += laws::Spring<V>{own[0], own[1]}.force(anchor.x - x[i], anchor.v - v[i]);
      }
    });
    each<N>([&](auto b) {
      each<b>([&](auto a) {
        constexpr std::uint32_t pair = b * (b - 1) / 2 + a;
        if (is_alike || N <= 3 || (linked & 1u << pair) != 0) {
          const V* const own = slot + pairs + (is_alike ? 0 : 2 * pair);
          const V force = laws::Spring<V>{own[0], own[1]}.force(x[a] - x[b], v[a] - v[b]);
          f[a] -= force;
          f[b] += force;
        }
      });
    });
  }

  void exert_links() const {
    const V* slot = packs_.slots + table_.first_link;
    const Law* law = table_.laws.data();
    for (const BatchLink& each_link : batch_.links) {
      with_law_type(*law, [&]<class Type>(Type) {
        link<V, Type>(packs_, slot, each_link.a, each_link.b, N);
      });
      slot += batch_link_slots;
      ++law;
    }
  }

  // The force inputs that are not the first on their mass.
  void push_again(const V* value) const {
    for (std::size_t i = 0; i < program_.inputs.size() && (table_.touched & table_.pushed) != 0;
         ++i) {
      const InputSlot& input = program_.inputs[i];
      if (input.is_force && input.node < N && table_.pusher[input.node] != i) {
        take_force(input.node, packs_, value + i * packs_.count);
      }
    }
  }

  const Program& program_;
  const Batch& batch_;
  const BatchTable& table_;
  const Packs<V>& packs_;
  std::size_t anchor_[N];
  std::size_t pusher_[N];
};

template <class V, std::uint32_t N, bool is_alike>
void hold(const Program& program, const Batch& batch, const BatchTable& table,
          BatchState<Scalar<V>>& state, const Block<Scalar<V>>& block) {
  const Packs<V> packs(table, state.cells);
  const Holder<V, N, is_alike> holder(program, batch, table, packs);
  const PassiveLinks passive(program, packs, state);
  Rows<V> rows(program, table, block);
  const auto* audio = block.audio;
  for (std::size_t frame = 0; frame < block.frames;) {
    const bool moves = move_coefficients(program, state.ramps, audio);
    fill_slots(table, reinterpret_cast<const V*>(state.ramps.value), packs);
    const std::size_t end = moves ? frame + 1 : block.frames;
    passive.remember();
    holder.move(rows.value);
    for (;;) {
      take_positions(program, packs, rows);
      passive.correct();
      give_positions(program, packs, rows.outputs);
      rows.advance();
      if (++frame == end) {
        break;
      }
      passive.remember();
      holder.exert_and_move(rows.value);
    }
    holder.exert();
  }
}

// --- masses in memory ----------------------------------------------------------------------------

template <class V>
void step_masses(const Program& program, const Packs<V>& packs) {
  const V* slots = packs.slots;
  for (const MassRun& run : program.mass_runs) {
    for (std::uint32_t i = run.first; i < run.first + run.count; ++i) {
      const V* slot = slots;
      for (std::size_t pack = 0; pack < packs.count; ++pack, slot += packs.stride) {
        Node<V>& node = packs.nodes(pack)[i];
        const V pull = slot[1] * node.x + slot[2] * node.v + slot[3];
        const V v = node.v + (node.force - pull) * slot[0];
        node.v = v;
        node.x += v;
        node.force = V{};
      }
    }
    slots += batch_run_slots;
  }
}

template <class V>
void step_links(const Program& program, const BatchTable& table, const Packs<V>& packs) {
  const V* slot = packs.slots + table.first_link;
  for (const LinkRun& run : program.link_runs) {
    if (run.scheme != Scheme::plain) {
      continue;
    }
    with_law_type(run.law, [&]<class Type>(Type) {
      const Ends* const ends = program.ends.data() + run.first;
      for (std::uint32_t i = 0; i < run.count; ++i) {
        link<V, Type>(packs, slot, ends[i].a, ends[i].b, program.moving);
      }
    });
    slot += batch_link_slots;
  }
}

template <class V>
void step_in_memory(const Program& program, const Batch&, const BatchTable& table,
                    BatchState<Scalar<V>>& state, const Block<Scalar<V>>& block) {
  const Packs<V> packs(table, state.cells);
  const PassiveLinks passive(program, packs, state);
  Rows<V> rows(program, table, block);
  const auto* audio = block.audio;
  for (std::size_t frame = 0; frame < block.frames; ++frame) {
    if (move_coefficients(program, state.ramps, audio) || frame == 0) {
      fill_slots(table, reinterpret_cast<const V*>(state.ramps.value), packs);
    }
    for (std::size_t i = 0; i < program.inputs.size(); ++i) {
      if (program.inputs[i].is_force) {
        take_force(program.inputs[i].node, packs, rows.value + i * packs.count);
      }
    }
    passive.remember();
    step_masses(program, packs);
    take_positions(program, packs, rows);
    passive.correct();
    step_links(program, table, packs);
    give_positions(program, packs, rows.outputs);
    rows.advance();
  }
}

// --- which ---------------------------------------------------------------------------------------

template <class V, bool is_alike>
BatchStep<Scalar<V>> hold_for(std::uint32_t held) {
  switch (held) {
    case 1:
      return hold<V, 1, is_alike>;
    case 2:
      return hold<V, 2, is_alike>;
    case 3:
      return hold<V, 3, is_alike>;
    default:
      return hold<V, 4, is_alike>;
  }
}

template <class V>
BatchStep<Scalar<V>> step_for(const BatchTable& table) {
  if (table.held == 0) {
    return step_in_memory<V>;
  }
  return table.is_alike ? hold_for<V, true>(table.held) : hold_for<V, false>(table.held);
}

template <class T>
BatchStep<T> step_in(const BatchTable& table, std::size_t bytes) {
  constexpr std::size_t widest = vector_bytes(Isa::RESSORT_ISA);
  return with_bytes<widest, std::min<std::size_t>(32, widest)>(
      bytes, [&]<std::size_t pack>() { return step_for<Pack<T, pack>>(table); });
}

}  // namespace
}  // namespace ressort::RESSORT_ISA

namespace ressort {

template <>
BatchStep<float> batch_step<Isa::RESSORT_ISA, float>(const BatchTable& table, std::size_t bytes) {
  return RESSORT_ISA::step_in<float>(table, bytes);
}

template <>
BatchStep<double> batch_step<Isa::RESSORT_ISA, double>(const BatchTable& table, std::size_t bytes) {
  return RESSORT_ISA::step_in<double>(table, bytes);
}

}  // namespace ressort
