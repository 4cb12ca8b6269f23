// core/kernels: a small network in many voices (Batch): one voice in each lane of many packs, which
// take every step of a sample in turn, so that none waits for its own last result.
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "core/kernels/nodes.h"
#include "core/laws/laws.h"

namespace ressort::kernels {

// Everything that a pack of voices needs lies together, one cell for each number:
//   of each node its position, its velocity and a force;
//   slots, which are copies of coefficients. Where masses are held, those
//     of the masses    1/M of each
//     of the springs   K and Z of each pair, then of each anchor
//     of the pulls     K, Z and g of each mass, if anything pulls any
//     of the links     as below, of each link
//   and otherwise
//     of the masses    1/M, K, Z and g of each run
//     of the links     the arguments of the law, or what it keeps instead, of each run
inline constexpr std::size_t batch_node_cells = 3;
inline constexpr std::size_t batch_run_slots = 4;
inline constexpr std::size_t batch_link_slots = most_kept_numbers;

struct BatchTable {
  struct Copy {
    std::uint32_t slot = 0;
    std::uint32_t coefficient = 0;
  };

  std::uint32_t nodes = 0;
  std::uint32_t held = 0;      // all masses, or none
  std::uint32_t linked = 0;    // a bit for each pair
  std::uint32_t anchored = 0;  // a bit for each mass held
  std::uint32_t touched = 0;   // ...that other links act on, or more than one force input
  std::uint32_t pushed = 0;    // ...that a force input acts on
  std::array<std::uint32_t, most_held_masses> pusher{};  // ...and the first of these inputs
  bool is_pulled = false;
  bool is_alike = false;  // masses held, and pairs: the slots of the first are those of all
  std::size_t packs = 1;
  std::size_t cells = 0;       // of one pack
  std::size_t first_link = 0;  // slots
  std::vector<Copy> copies;    // what is in no slot stays 0
  std::vector<Law> laws;       // of the links
};

// Everything that one step of BatchKernel touches.
template <class T>
struct BatchState {
  Ramps<T> ramps;
  T* cells;  // [pack][cell][lane]
  const PassiveTables& passive;
  const std::uint32_t* inverse_mass;  // [moving node] coefficient, if there are passive links
  T* memory;                          // [pack][passive link][passive_rows][lane]
  T* solver;                          // PassiveRoom::numbers
  T* awake;  // [pack][lane] 0 in the first sample after set_state(), else 1
};

template <class T>
using BatchStep = void (*)(const Program& program, const Batch& batch, const BatchTable& table,
                           BatchState<T>& state, const Block<T>& block);

// Of a pack. Half of AVX2's registers would be no faster than all of them, so that nothing is
// compiled for these; AVX-512's whole ones take two turns on many a machine.
template <class T>
constexpr std::size_t batch_lanes(std::size_t voices, Isa isa) {
  const std::size_t least = std::min<std::size_t>(32, vector_bytes(isa)) / sizeof(T);
  return std::max(least, lanes_for<T>(voices, isa));
}

// The function for packs of so many bytes, as batch_lanes() says.
template <Isa isa, class T>
BatchStep<T> batch_step(const BatchTable& table, std::size_t bytes);

template <class T>
class BatchKernel final : public NodeKernel<T> {
 public:
  BatchKernel(const Program& program, const Batch& batch, std::size_t voices, Isa isa);
  bool become(const Kernel<T>& from) override {
    this->become_nodes(from);
    return true;
  }
  bool takes_common_inputs() const override { return true; }

 private:
  // Of packs of so many lanes.
  BatchKernel(const Program& program, const Batch& batch, BatchTable table, std::size_t lanes,
              Isa isa);
  void play(const Block<T>& block) override;
  bool keeps_forces() const override { return true; }

  const Batch& batch_;
  BatchTable table_;
  BatchStep<T> step_;
};

}  // namespace ressort::kernels
