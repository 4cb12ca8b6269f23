// The packs of the batch kernel and the operations on all of them in turn. Included by *_step.cpp,
// which are compiled for each instruction set.
#pragma once

#include <algorithm>

#include "core/kernels/batch/batch.h"
#include "core/laws/laws.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

template <class V>
struct Node {
  V x;
  V v;
  V force;
};

// A law that can be stored as numbers derived from its arguments.
template <class ForceLaw, class V>
concept Kept = requires(const ForceLaw& law, V* row) {
  law.keep(row);
};

// Returns the law in a link's slots.
template <class V, class Type>
[[gnu::always_inline]] inline auto law_in(const V* slot) {
  using ForceLaw = typename Type::template With<V>;
  if constexpr (Kept<ForceLaw, V>) {
    return ForceLaw(slot);
  } else {
    return law_of<Type, V>([&](std::size_t i) { return slot[i]; });
  }
}

template <class V>
constexpr std::size_t lanes_of = sizeof(V) / sizeof(Scalar<V>);

// A range of packs that take each operation in turn.
template <class V>
struct Packs {
  // Selects, of all packs in each row, those with playing lanes.
  Packs(const BatchTable& table, void* memory, std::size_t lanes)
      : all(table.packs),
        count(std::min(all, lanes / lanes_of<V> + (lanes % lanes_of<V> != 0 ? 1 : 0))),
        stride(table.cells),
        cells(static_cast<V*>(memory)),
        slots(cells + batch_node_cells * table.nodes) {}

  Node<V>* nodes(std::size_t pack) const {
    return reinterpret_cast<Node<V>*>(cells + pack * stride);
  }

  // Returns a subrange.
  Packs some(std::size_t first, std::size_t so_many) const {
    Packs packs = *this;
    packs.first += first;
    packs.count = so_many;
    packs.cells += first * stride;
    packs.slots += first * stride;
    return packs;
  }

  std::size_t all;
  std::size_t first = 0;  // Number of the first of these packs in each row.
  std::size_t count;
  std::size_t stride;
  V* cells;
  V* slots;
};

// Position of a block in the input and output rows of all voices.
template <class V>
struct Rows {
  using T = Scalar<V>;

  Rows(const Program& program, const BatchTable& table, const auto& block)
      : value(block.value),
        velocity(block.velocity),
        outputs(reinterpret_cast<V*>(block.outputs)),
        is_common(block.is_common),
        is_still(block.is_still),
        input(is_common ? 1 : table.packs * lanes_of<V>),
        in(program.inputs.size() * input),
        out(program.outputs.size() * table.packs) {}

  Rows from(std::size_t pack) const {
    Rows rows = *this;
    rows.value += is_common ? 0 : pack * lanes_of<V>;
    rows.velocity += is_common ? 0 : pack * lanes_of<V>;
    rows.outputs += pack;
    return rows;
  }
  void advance() {
    value += in;
    velocity += in;
    outputs += out;
  }
  // Reads an input, starting at its first pack.
  [[gnu::always_inline]] V take(const T* first, std::size_t pack) const {
    return is_common ? *first - V{} : load<V>(first + pack * lanes_of<V>);
  }

  const T* value;
  const T* velocity;
  V* outputs;
  bool is_common;
  bool is_still;      // All samples of the inputs are the same.
  std::size_t input;  // Numbers per sample of an input and an output.
  std::size_t in;
  std::size_t out;
};

// Advances the ramps; returns whether any coefficient moved.
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

// Copies the current coefficients to the slots, and computes the numbers derived from them.
template <class V>
void fill_slots(const BatchTable& table, const V* coefficients, const Packs<V>& packs) {
  for (const BatchTable::Copy copy : table.copies) {
    const V* const from = coefficients + copy.coefficient * packs.all;
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
[[gnu::always_inline]] inline void take_positions(const Program& program, const Packs<V>& packs,
                                                  const Rows<V>& rows) {
  const auto* value = rows.value;
  const auto* velocity = rows.velocity;
  for (const InputSlot& input : program.inputs) {
    for (std::size_t pack = 0; pack < packs.count && !input.is_force; ++pack) {
      Node<V>& node = packs.nodes(pack)[input.node];
      node.x = rows.take(value, pack);
      node.v = rows.take(velocity, pack);
    }
    value += rows.input;
    velocity += rows.input;
  }
}

template <class V>
void take_force(const InputSlot& input, std::size_t i, const Packs<V>& packs, const Rows<V>& rows) {
  for (std::size_t pack = 0; pack < packs.count; ++pack) {
    packs.nodes(pack)[input.node].force += rows.take(rows.value + i * rows.input, pack);
  }
}

template <class V>
void give_positions(const Program& program, const Packs<V>& packs, V* outputs) {
  for (const OutputSlot& output : program.outputs) {
    for (std::size_t pack = 0; pack < packs.count; ++pack) {
      outputs[pack] = packs.nodes(pack)[output.node].x;
    }
    outputs += packs.all;
  }
}

// Adds a link's force to its masses.
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

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA
