// core/engine: a network without any order (Sparse), its masses side by side in the lanes. One
// voice.
#pragma once

#include "core/kernels/kernel.h"

namespace ressort {

// Of one pack: what is looked up comes number by number, wider ones would only wait longer.
constexpr std::size_t sparse_bytes(std::size_t vector_bytes) {
  return vector_bytes < 32 ? vector_bytes : 32;
}

// Where a coefficient's value is kept: held[places[i]] for first <= i < first + count.
struct SparsePins {
  std::uint32_t first = 0;
  std::uint32_t count = 0;
};

// The rows of links that the masses of one pack own, of one law.
struct SparseOwners {
  std::uint32_t slot = 0;  // of the pack's first mass
  std::uint32_t rows = 0;
};

// The links of one law.
struct SparseLaw {
  Law law = Law::spring;
  std::uint32_t first = 0;   // of SparseState::owners
  std::uint32_t count = 0;   //
  std::uint32_t row = 0;     // the first of its own
  std::uint32_t held = 0;    // [row][5][lane] from there; if all are of one run, [5][lane]
  std::uint32_t stride = 0;  // from row to row: 0 if all are of one run
};

// Everything that one step of SparseKernel touches. Slots are the masses in the form's order, then,
// from the next pack on, what has no inertia. Numbers to be looked up are `signals`: y of every
// slot, then the force of every row and lane, then a pack of zeros.
template <class T>
struct SparseState {
  Ramps<T> ramps;
  T* x;        // [slot] position
  T* v;        // [slot] change of position per sample
  T* pairs;    // [slot][2] both, if there are rows
  T* force;    // [slot] of own links and force inputs, used by the next sample
  T* signals;  //
  T* held;     // [1/M, and if a mass is pulled K, Z, g][slot that moves], then of each law
  bool is_pulled;
  std::size_t moving;         // slots of masses, multiples of a pack
  std::size_t slots;          // all of them, so too
  const std::uint32_t* slot;  // [node]
  // [pack][y, forces] where they begin in `looked_up`; then where all ends
  const std::uint32_t* lists;
  const std::uint32_t* looked_up;  // [row of a list][lane] signals
  const SparsePins* pins;          // [coefficient]
  const std::uint32_t* places;     // of held
  const SparseLaw* laws;
  std::size_t law_count;
  const SparseOwners* owners;
  const std::uint32_t* others;  // [row][lane] of pairs
  const T* signs;  // [row][lane] 1, or -1 where the owner is the second end; 0: no link
};

template <class T>
using SparseStep = void (*)(const Program& program, const Sparse& sparse, SparseState<T>& state,
                            const Block<T>& block);

template <Isa isa, class T>
SparseStep<T> sparse_step();

template <class T>
class SparseKernel final : public Kernel<T> {
 public:
  SparseKernel(const Program& program, const Sparse& sparse, Isa isa);
  void place(std::size_t lane, const double* x, const double* v) override;
  bool save(std::size_t lane, double* x, double* v) const override;
  bool is_near_start(std::size_t lane, double bound) const override;

 private:
  void play(const Block<T>& block) override;
  void make_slots();
  void make_laws();
  void make_rows(const std::vector<SparseLink>& links, SparseLaw& law);
  void add_link(const SparseLink& link, std::size_t lane);
  void add_nothing(const SparseLink& like, std::size_t slot, std::size_t lane);
  void pin_all(const SparseLink& link, std::size_t lane);
  void make_lists();
  void make_pins();
  void pin(std::uint32_t coefficient, std::size_t place);
  std::size_t round_up(std::size_t count) const { return (count + lanes_ - 1) / lanes_ * lanes_; }

  const Program& program_;
  const Sparse& sparse_;
  SparseStep<T> step_;
  std::size_t lanes_;
  std::size_t moving_ = 0;
  std::size_t slots_ = 0;
  bool is_pulled_ = false;
  std::vector<std::uint32_t> slot_;
  std::vector<SparseLaw> laws_;
  std::vector<SparseOwners> owners_;
  std::vector<std::uint32_t> others_;
  Aligned<T> signs_;
  std::vector<std::uint32_t> lists_;
  std::vector<std::uint32_t> looked_up_;
  std::vector<std::vector<std::uint32_t>> heard_;   // [slot] signals, while the tables are made
  std::vector<std::vector<std::uint32_t>> pinned_;  // [coefficient] places, so too
  std::vector<SparsePins> pins_;
  std::vector<std::uint32_t> places_;
  Aligned<T> x_;
  Aligned<T> v_;
  Aligned<T> pairs_;
  Aligned<T> force_;
  Aligned<T> signals_;
  Aligned<T> held_;
};

}  // namespace ressort
