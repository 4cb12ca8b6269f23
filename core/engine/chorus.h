// core/engine: a small network in many voices (Chorus): one voice in each lane of several packs,
// which are stepped in turn within a sample, so that none waits for its own last result.
#pragma once

#include <array>
#include <vector>

#include "core/engine/kernel.h"

namespace ressort {

// What one number takes in all of a kernel's voices, at most.
inline constexpr std::size_t chorus_bytes = 128;

// Everything that a pack of voices needs lies together, one cell for each number:
//   slots   coefficients, copied to where they are used: 1/M of the masses; K and Z of the pairs,
//           then of the anchors
//   nodes   position, velocity and force of each
//   pulls   K, Z and g of each mass, if any is pulled by itself or by gravity
//   links   those of each run of links
inline constexpr std::uint32_t chorus_link_slots = 6;
inline constexpr std::uint32_t chorus_zero = 0xffffffffu;  // no coefficient

constexpr std::uint32_t chorus_slots(std::uint32_t masses, std::uint32_t held) {
  return masses + held * (held - 1) + 2 * held;
}

struct ChorusTable {
  std::uint32_t masses = 0;
  std::uint32_t nodes = 0;
  std::uint32_t packs = 0;
  std::uint32_t held = 0;      // all masses, or none
  std::uint32_t linked = 0;    // a bit for each pair
  std::uint32_t anchored = 0;  // a bit for each mass held
  std::uint32_t pushed = 0;    // a bit for each mass held that a force input acts on
  std::array<std::uint32_t, most_held_masses> pusher{};  // ...and the first of these inputs
  bool is_pulled = false;
  std::uint32_t first_node = 0;  // cells
  std::uint32_t first_pull = 0;
  std::uint32_t first_link = 0;
  std::uint32_t cells = 0;
  std::vector<std::uint32_t> slots;  // coefficients or chorus_zero
  std::vector<std::uint32_t> pulls;
};

// Everything that one step of ChorusKernel touches.
template <class T>
struct ChorusState {
  Ramps<T> ramps;
  T* cells;  // [pack][cell][lane]
};

template <class T>
using ChorusStep = void (*)(const Program& program, const Chorus& chorus, const ChorusTable& table,
                            ChorusState<T>& state, const Block<T>& block);

// The function for so many masses held, in packs of so many bytes; 128 are a twin of 64.
template <Isa isa, class T>
ChorusStep<T> chorus_step(std::uint32_t held, std::size_t bytes);

template <class T>
class ChorusKernel final : public Kernel<T> {
 public:
  ChorusKernel(const Program& program, const Chorus& chorus, std::size_t voices, Isa isa);
  void place(std::size_t lane, const double* x, const double* v) override;
  bool save(std::size_t lane, double* x, double* v) const override;
  bool is_near_start(std::size_t lane, double bound) const override;

 private:
  void play(const Block<T>& block) override;
  // Where a node's position is; its velocity and its force are one and two packs after it.
  std::size_t at(std::size_t node, std::size_t lane) const {
    const std::size_t cell = lane / lanes_ * table_.cells + table_.first_node + 3 * node;
    return cell * lanes_ + lane % lanes_;
  }
  const Program& program_;
  const Chorus& chorus_;
  std::size_t lanes_;  // of one pack, or of two that are worked on as one
  ChorusTable table_;
  ChorusStep<T> step_;
  Aligned<T> cells_;
};

}  // namespace ressort
