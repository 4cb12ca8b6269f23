// The loops of the batch kernel, compiled for each instruction set.
#include <array>
#include <type_traits>

#include "core/kernels/batch/batch_packs.h"
#include "core/kernels/passive/passive.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

// Calls `use` with the constants 0 to N-1, so that the compiler keeps indexed values in registers.
template <std::uint32_t N, std::uint32_t I = 0, class Use>
[[gnu::always_inline]] inline void each(Use&& use) {
  if constexpr (I < N) {
    use(std::integral_constant<std::uint32_t, I>{});
    each<N, I + 1>(use);
  }
}

// --- passive links -------------------------------------------------------------------------------

// The passive links of one pack.
template <class V>
struct Passive {
  CoefficientView<V> coefficients() const { return all; }
  V awake() const { return is_awake; }
  V distance_now(Ends ends) const { return nodes[ends.a].x - nodes[ends.b].x; }
  V speed_now(Ends ends) const { return nodes[ends.a].v - nodes[ends.b].v; }
  V distance(Ends ends) const { return distance_now(ends); }
  V speed(Ends ends) const { return speed_now(ends); }
  V gamma(Ends ends) const { return ends.a == ends.b ? V{} : give(ends.a) + give(ends.b); }
  void push(Ends ends, V force) {
    if (any_of(force != V{})) {
      push_node(ends.a, -force);
      push_node(ends.b, force);
    }
  }
  void shift(std::uint32_t node, V way) {
    nodes[node].x += way;
    nodes[node].v += way;
  }
  void add_reaction(std::uint32_t, V) {}

  V give(std::uint32_t node) const { return node < masses ? all[inverse_mass[node]] : V{}; }
  void push_node(std::uint32_t node, V force) {
    if (node < masses) {
      shift(node, give(node) * force);
    }
  }

  Node<V>* nodes;
  CoefficientView<V> all;  // Coefficients of the pack; the next coefficient is `packs` further.
  const std::uint32_t* inverse_mass;
  std::uint32_t masses;
  V is_awake;
};

template <class V, class T>
class PassiveLinks {
 public:
  PassiveLinks(const Program& program, const Packs<V>& packs, BatchState<T>& state)
      : program_(program), packs_(packs), state_(state), is_any_(!state.passive.links.empty()) {}

  bool is_any() const { return is_any_; }
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

  // Returns whether a Watch is possible: in no lane is this the first sample, and all links have a
  // zone.
  bool may_rest() const {
    bool are_awake = true;
    for (std::size_t pack = 0; pack < packs_.count; ++pack) {
      are_awake &= !any_of(body(pack).is_awake <= V{});
    }
    const std::vector<PassiveLink>& links = state_.passive.links;
    return are_awake && links.size() <= Watch::most &&
           std::all_of(links.begin(), links.end(), [](const PassiveLink& link) {
             return link.zone == Zone::near || link.zone == Zone::below;
           });
  }

  // Watches whether any link can act, after masses and inputs have moved.
  class Watch {
   public:
    static constexpr std::size_t most = 3;

    explicit Watch(const PassiveLinks& links) {
      for (std::size_t pack = 0; pack < links.packs_.count; ++pack) {
        const Passive<V> own = links.body(pack);
        const V* row = links.memory(pack);
        for (const PassiveLink& link : links.state_.passive.links) {
          rows_[count_++] = {
              own.nodes + link.ends.a, own.nodes + link.ends.b, own.all[link.reach], row[0], row[1],
              link.zone == Zone::below};
          row += passive_rows;
        }
      }
    }
    [[gnu::always_inline]] void look() {
      for (std::size_t i = 0; i < count_; ++i) {
        Row& row = rows_[i];
        const laws::LinkState<V> state{
            .now = row.now, .speed = row.speed, .free = row.a->x - row.b->x};
        acts_ |= acting_lanes(row.is_below, state, row.reach);
        row.now = state.free;
        row.speed = row.a->v - row.b->v;
      }
    }
    bool has_acted() const { return any_of(acts_); }

   private:
    struct Row {
      const Node<V>* a;
      const Node<V>* b;
      V reach;
      V now;
      V speed;
      bool is_below;
    };
    std::size_t count_ = 0;
    std::array<Row, 3 * most> rows_;
    decltype(V{} < V{}) acts_{};
  };

 private:
  Passive<V> body(std::size_t pack) const {
    return {
        .nodes = packs_.nodes(pack),
        .all = {reinterpret_cast<const V*>(state_.ramps.value) + packs_.first + pack, packs_.all},
        .inverse_mass = state_.inverse_mass,
        .masses = program_.moving,
        .is_awake = reinterpret_cast<const V*>(state_.awake)[packs_.first + pack]};
  }
  V* memory(std::size_t pack) const {
    return reinterpret_cast<V*>(state_.memory) +
           (packs_.first + pack) * passive_rows * state_.passive.links.size();
  }

  [[gnu::noinline]] void remember_all() const {
    for (std::size_t pack = 0; pack < packs_.count; ++pack) {
      RESSORT_ISA::remember(state_.passive, memory(pack), body(pack));
    }
  }
  [[gnu::noinline]] void correct_all() const {
    for (std::size_t pack = 0; pack < packs_.count; ++pack) {
      Passive<V> own = body(pack);
      RESSORT_ISA::correct(state_.passive, memory(pack), reinterpret_cast<V*>(state_.solver), own);
      reinterpret_cast<V*>(state_.awake)[packs_.first + pack] = V{} + 1;
    }
  }

  const Program& program_;
  const Packs<V>& packs_;
  BatchState<T>& state_;
  bool is_any_;
};

// --- masses in registers -------------------------------------------------------------------------

// A sample's step has two halves: the springs exert their forces, and the forces move the masses
// (symplectic Euler). Within a block, the second half of one sample and the first half of the next
// are fused, so that forces never leave the registers. Only those of a block's last sample are
// stored.
enum class Half { move, exert, exert_and_move };

// Exerts all links that are not springs in registers. One function for any number of masses.
template <class V>
[[gnu::noinline]] void exert_links(const Batch& batch, const BatchTable& table,
                                   const Packs<V>& packs) {
  const V* slot = packs.slots + table.first_link;
  const Law* law = table.laws.data();
  for (const BatchLink& each_link : batch.links) {
    with_law_type(*law, [&]<class Type>(Type) {
      link<V, Type>(packs, slot, each_link.a, each_link.b, table.held);
    });
    slot += batch_link_slots;
    ++law;
  }
}

// Prefetch distance in packs: only a few packs of a row are read at a time, which the hardware
// prefetcher does not predict.
constexpr std::size_t rows_ahead = 12;

constexpr std::size_t most_restored = 8;  // Nodes of a pack that a block may put back.

struct SpringsAlone {};  // Stands for: no other links.
template <Law law>
using TypeOf = std::tuple_element_t<static_cast<std::size_t>(law), Laws>;

template <class V, std::uint32_t N, bool is_alike>
class Holder {
 public:
  Holder(const Program& program, const Batch& batch, const BatchTable& table, const Packs<V>& packs)
      : program_(program), batch_(batch), table_(table), packs_(packs) {
    each<N>([&](auto i) {
      anchor_[i] = batch.anchors[i].node;
      pusher_[i] = table.pusher[i];
    });
  }

  void move(const Rows<V>& rows) const {
    push_again(rows);
    pass<Half::move>(rows);
  }
  void exert(const Rows<V>& rows) const {
    exert_links(batch_, table_, packs_);
    pass<Half::exert>(rows);
  }
  void exert_and_move(const Rows<V>& rows) const {
    exert_links(batch_, table_, packs_);
    push_again(rows);
    pass<Half::exert_and_move>(rows);
  }

  // Steps P packs for all `frames` samples without leaving the registers. The masses are joined by
  // springs, and have either links of one type or one force input each. Returns false, with the
  // state as before, if a passive link may act.
  template <std::uint32_t P, class Type, class Passives>
  [[gnu::always_inline]] bool stay(Rows<V> rows, std::size_t frames,
                                   const Passives& passives) const {
    V x[P][N];
    V v[P][N];
    V f[P][N];
    Node<V> before[P][most_restored];
    each<P>([&](auto p) {
      each<N>([&](auto i) {
        x[p][i] = packs_.nodes(p)[i].x;
        v[p][i] = packs_.nodes(p)[i].v;
        f[p][i] = packs_.nodes(p)[i].force;
      });
    });
    each<P>([&](auto p) { std::copy_n(packs_.nodes(p), table_.nodes, before[p]); });
    passives.remember();
    typename Passives::Watch watch(passives);
    const std::uint32_t anchored = table_.anchored;
    const std::uint32_t linked = table_.linked;
    const std::uint32_t pushed = table_.pushed;
    for (std::size_t frame = 0; frame < frames; ++frame) {
      each<P>([&](auto p) {
        const V* const slot = packs_.slots + p * packs_.stride;
        each<N>([&](auto i) {
          if ((pushed & 1u << i) != 0) {
            const auto* const value = rows.value + pusher_[i] * rows.input;
            f[p][i] += rows.take(value, p);
            __builtin_prefetch(value + rows_ahead * rows.in + p * lanes_of<V>);
          }
          v[p][i] += f[p][i] * slot[is_alike ? 0 : i()];
          x[p][i] += v[p][i];
          packs_.nodes(p)[i].x = x[p][i];
          f[p][i] = V{};
        });
      });
      if (!rows.is_still || frame == 0) {
        take_positions(program_, packs_, rows);
      }
      if (passives.is_any()) {
        each<P>([&](auto p) { each<N>([&](auto i) { packs_.nodes(p)[i].v = v[p][i]; }); });
        watch.look();
        // A test in every sample would cost as much as the sample.
        if ((frame % 8 == 0 || frame + 1 == frames) && watch.has_acted()) {
          each<P>([&](auto p) { std::copy_n(before[p], table_.nodes, packs_.nodes(p)); });
          return false;
        }
      }
      give_positions(program_, packs_, rows.outputs);
      rows.advance();
      each<P>([&](auto p) {
        const V* const slot = packs_.slots + p * packs_.stride;
        if constexpr (!std::is_same_v<Type, SpringsAlone>) {
          exert_all<Type>(packs_.nodes(p), slot + table_.first_link, x[p], v[p], f[p]);
        }
        exert_springs(packs_.nodes(p), slot, anchored, linked, x[p], v[p], f[p]);
      });
    }
    each<P>([&](auto p) {
      each<N>([&](auto i) {
        packs_.nodes(p)[i].v = v[p][i];
        packs_.nodes(p)[i].force = f[p][i];
      });
    });
    return true;
  }

 private:
  static constexpr std::uint32_t pairs = N;  // Slots.
  static constexpr std::uint32_t anchors = pairs + N * (N - 1);
  static constexpr std::uint32_t pulls = anchors + 2 * N;

  template <Half half>
  [[gnu::always_inline]] void pass(const Rows<V>& rows) const {
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
          f[i] += rows.take(rows.value + pusher_[i] * rows.input, pack);
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

  // Exerts the links of one type on masses in registers.
  template <class Type>
  [[gnu::always_inline]] void exert_all(const Node<V>* nodes, const V* slot, const V (&x)[N],
                                        const V (&v)[N], V (&f)[N]) const {
    for (const BatchLink& each_link : batch_.links) {
      V d = nodes[each_link.a].x - nodes[each_link.b].x;
      V speed = nodes[each_link.a].v - nodes[each_link.b].v;
      each<N>([&](auto i) {
        if (each_link.a == i) {
          d = x[i] - nodes[each_link.b].x;
          speed = v[i] - nodes[each_link.b].v;
        } else if (each_link.b == i) {
          d = nodes[each_link.a].x - x[i];
          speed = nodes[each_link.a].v - v[i];
        }
      });
      const V force = law_in<V, Type>(slot).force(d, speed);
      each<N>([&](auto i) {
        if (each_link.a == i) {
          f[i] -= force;
        } else if (each_link.b == i) {
          f[i] += force;
        }
      });
      slot += batch_link_slots;
    }
  }

  // For three masses, missing springs are computed with coefficients of 0, which avoids branches.
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

  // Adds the second and later force inputs of a mass.
  void push_again(const Rows<V>& rows) const {
    for (std::size_t i = 0; i < program_.inputs.size() && (table_.touched & table_.pushed) != 0;
         ++i) {
      const InputSlot& input = program_.inputs[i];
      if (input.is_force && input.node < N && table_.pusher[input.node] != i) {
        take_force(input, i, packs_, rows);
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

// Steps a sample of all packs after the other.
template <class V, std::uint32_t N, bool is_alike, class Passives>
void take_turns(const Holder<V, N, is_alike>& holder, const Program& program, const Packs<V>& packs,
                const Passives& passive, Rows<V> rows, std::size_t frames) {
  passive.remember();
  holder.move(rows);
  for (std::size_t frame = 0;;) {
    take_positions(program, packs, rows);
    passive.correct();
    give_positions(program, packs, rows.outputs);
    rows.advance();
    if (++frame == frames) {
      break;
    }
    passive.remember();
    holder.exert_and_move(rows);
  }
  holder.exert(rows);
}

// Steps some packs in registers for as long as no passive link may act. Two packs hide each
// other's latency; three fit into 32 registers.
template <class V, std::uint32_t N, bool is_alike, class Type>
void hold_in_registers(const Program& program, const Batch& batch, const BatchTable& table,
                       BatchState<Scalar<V>>& state, const Packs<V>& packs, const Rows<V>& rows,
                       std::size_t frames) {
  constexpr bool has_links = !std::is_same_v<Type, SpringsAlone>;
  const auto stay = [&]<std::uint32_t P>(std::size_t first) {
    const Packs<V> some = packs.some(first, P);
    const PassiveLinks passive(program, some, state);
    const Holder<V, N, is_alike> holder(program, batch, table, some);
    if ((passive.is_any() && !passive.may_rest()) ||
        !holder.template stay<P, Type>(rows.from(first), frames, passive)) {
      take_turns(holder, program, some, passive, rows.from(first), frames);
    }
  };
  constexpr bool has_three = !has_links && sizeof(V) == 64;
  const std::size_t left = packs.count % 2;
  const std::size_t pairs = packs.count - (left == 1 && packs.count >= 3 && has_three ? 3 : left);
  for (std::size_t first = 0; first < pairs; first += 2) {
    stay.template operator()<2>(first);
  }
  if constexpr (has_three) {
    if (pairs + 3 == packs.count) {
      return stay.template operator()<3>(pairs);
    }
  }
  if (left == 1) {
    stay.template operator()<1>(pairs);
  }
}

// Does the same if there are no other links, or only links of one common law; returns whether it
// did.
template <class V, std::uint32_t N, bool is_alike>
bool could_hold_in_registers(const Program& program, const Batch& batch, const BatchTable& table,
                             BatchState<Scalar<V>>& state, const Packs<V>& packs,
                             const Rows<V>& rows, std::size_t frames) {
  const auto hold = [&]<class Type>(Type) {
    hold_in_registers<V, N, is_alike, Type>(program, batch, table, state, packs, rows, frames);
    return true;
  };
  if ((table.touched & table.pushed) != 0 || table.is_pulled ||
      (!state.passive.links.empty() && table.nodes > most_restored)) {
    return false;
  }
  if (table.laws.empty()) {
    return hold(SpringsAlone{});
  }
  if constexpr (is_alike && sizeof(V) == 64) {
    const auto is_all = [&](Law law) {
      return state.passive.links.empty() &&
             std::all_of(table.laws.begin(), table.laws.end(), [=](Law l) { return l == law; });
    };
    if (is_all(Law::pluck)) {
      return hold(TypeOf<Law::pluck>{});
    }
    if (is_all(Law::contact)) {
      return hold(TypeOf<Law::contact>{});
    }
  }
  return false;
}

template <class V, std::uint32_t N, bool is_alike>
void hold(const Program& program, const Batch& batch, const BatchTable& table,
          BatchState<Scalar<V>>& state, const Block<Scalar<V>>& block) {
  const Packs<V> packs(table, state.cells, block.lanes);
  const Holder<V, N, is_alike> holder(program, batch, table, packs);
  const PassiveLinks passive(program, packs, state);
  Rows<V> rows(program, table, block);
  const auto* audio = block.audio;
  for (std::size_t frame = 0; frame < block.frames; rows.advance()) {
    const bool moves = move_coefficients(program, state.ramps, audio);
    fill_slots(table, reinterpret_cast<const V*>(state.ramps.value), packs);
    const std::size_t frames = moves ? 1 : block.frames - frame;
    if (moves || !could_hold_in_registers<V, N, is_alike>(program, batch, table, state, packs, rows,
                                                          frames)) {
      take_turns(holder, program, packs, passive, rows, frames);
    }
    frame += frames;
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
  const Packs<V> packs(table, state.cells, block.lanes);
  const PassiveLinks passive(program, packs, state);
  Rows<V> rows(program, table, block);
  const auto* audio = block.audio;
  for (std::size_t frame = 0; frame < block.frames; ++frame) {
    if (move_coefficients(program, state.ramps, audio) || frame == 0) {
      fill_slots(table, reinterpret_cast<const V*>(state.ramps.value), packs);
    }
    for (std::size_t i = 0; i < program.inputs.size(); ++i) {
      if (program.inputs[i].is_force) {
        take_force(program.inputs[i], i, packs, rows);
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

// --- dispatch ------------------------------------------------------------------------------------

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
}  // namespace ressort::kernels::RESSORT_ISA

namespace ressort::kernels {

template <>
BatchStep<float> batch_step<Isa::RESSORT_ISA, float>(const BatchTable& table, std::size_t bytes) {
  return RESSORT_ISA::step_in<float>(table, bytes);
}

template <>
BatchStep<double> batch_step<Isa::RESSORT_ISA, double>(const BatchTable& table, std::size_t bytes) {
  return RESSORT_ISA::step_in<double>(table, bytes);
}

}  // namespace ressort::kernels
