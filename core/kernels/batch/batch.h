// core/kernels: a small network in many voices (Batch). Each lane of many packs holds one voice.
// The packs take every step of a sample in turn, which hides the latency of the arithmetic.
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "core/kernels/batch/batch_form.h"
#include "core/kernels/nodes.h"
#include "core/laws/law.h"

namespace ressort::kernels {

// The numbers of a pack of voices are contiguous, one cell each:
//  of each node its position, its velocity and a force;
//  slots, which are copies of coefficients. If masses are held in registers, those
//    of the masses    1/M of each
//    of the springs   K and Z of each pair, then of each anchor
//    of the pulls     K, Z and g of each mass, if anything pulls any
//    of the links     as below, of each link
//  and otherwise
//    of the masses    1/M, K, Z and g of each run
//    of the links     the arguments of the law, or numbers derived from them, of each run
inline constexpr std::size_t batch_node_cells = 3;
inline constexpr std::size_t batch_run_slots = 4;
inline constexpr std::size_t batch_link_slots = most_kept_numbers;

struct BatchTable {
  struct Copy {
    std::uint32_t slot = 0;
    std::uint32_t coefficient = 0;
  };

  std::uint32_t nodes = 0;
  std::uint32_t held = 0;      // Number of masses in registers: all, or 0.
  std::uint32_t linked = 0;    // Bit mask of pairs with a spring.
  std::uint32_t anchored = 0;  // Bit mask of masses in registers with an anchor.
  std::uint32_t touched = 0;   // The same, of masses with other links or more than one force input.
  std::uint32_t pushed = 0;    // The same, of masses with a force input.
  std::array<std::uint32_t, most_held_masses> pusher{};  // First force input of each such mass.
  bool is_pulled = false;
  bool is_alike = false;  // All masses in registers and all pairs share the slots of the first.
  std::size_t packs = 1;
  std::size_t cells = 0;       // Per pack.
  std::size_t first_link = 0;  // Slots before those of the links.
  std::vector<Copy> copies;    // Slots without an entry stay 0.
  std::vector<Law> laws;       // [link]
};

// All data that one step of BatchKernel reads and writes.
template <class T>
struct BatchState {
  Ramps<T> ramps;
  T* cells;  // [pack][cell][lane]
  const PassiveTables& passive;
  const std::uint32_t* inverse_mass;  // [moving node] Coefficient; only with passive links.
  T* memory;                          // [pack][passive link][passive_rows][lane]
  T* solver;                          // Size: PassiveRoom::numbers.
  T* awake;  // [pack][lane] 0 in the first sample after set_state(), else 1.
};

template <class T>
using BatchStep = void (*)(const Program& program, const Batch& batch, const BatchTable& table,
                           BatchState<T>& state, const Block<T>& block);

// Returns the lanes per pack. Half-width AVX2 registers would be no faster than full ones, so no
// code is compiled for them. On many machines AVX-512 instructions take two cycles.
template <class T>
constexpr std::size_t batch_lanes(std::size_t voices, Isa isa) {
  const std::size_t least = std::min<std::size_t>(32, vector_bytes(isa)) / sizeof(T);
  return std::max(least, lanes_for<T>(voices, isa));
}

// Returns the function for packs of this size, as in batch_lanes().
template <Isa isa, class T>
BatchStep<T> batch_step(const BatchTable& table, std::size_t bytes);

template <class T>
class BatchKernel final : public NodeKernel<T> {
 public:
  BatchKernel(const Program& program, const Batch& batch, std::size_t voices, Isa isa);
  bool copy_from(const Kernel<T>& from) override {
    this->copy_nodes(from);
    return true;
  }
  bool takes_common_inputs() const override { return true; }

 private:
  // Makes a kernel whose packs have this many lanes.
  BatchKernel(const Program& program, const Batch& batch, BatchTable table, std::size_t lanes,
              Isa isa);
  void play(const Block<T>& block) override;
  bool keeps_forces() const override { return true; }

  const Batch& batch_;
  BatchTable table_;
  BatchStep<T> step_;
};

}  // namespace ressort::kernels
