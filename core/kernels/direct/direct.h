// core/engine: the published scheme, mass by mass and link by link, one voice in each lane. Runs
// every Program; the reference for all other kernels.
//
// In (position, velocity) form it is the same maths as 2x[n] - x[n-1], and keeps 10 to 80 dB more
// in single precision: the velocity is a small number of its own instead of the difference of two
// large ones.
#pragma once

#include "core/kernels/kernel.h"
#include "core/kernels/passive.h"
#include "core/kernels/taps.h"

namespace ressort {

// Everything that one step of DirectKernel touches.
template <class T>
struct DirectState {
  Ramps<T> ramps;
  T* x;                 // [node][lane] position
  T* v;                 // [node][lane] change of position per sample
  T* force;             // [node][lane] summed by the links, used by the next sample
  Corners<T>* corners;  // [tap][lane] in this sample
  std::size_t nodes;
  const std::vector<PassiveLink>& passive;
  const std::uint32_t* inverse_mass;  // [moving node] coefficient, if there are passive links
  T* memory;                          // [passive link][passive_rows][lane]
  T* awake;                           // [lane] 0 in the first sample after set_state(), else 1
  T* felt;  // [node][lane] what passive links did in this sample; null: nobody listens
  // Only where positions are compensated:
  T* rest = nullptr;              // [node][lane] what a position is more than x
  const T* value_rest = nullptr;  // [frame][input][lane] the same of the position inputs
  T* output_rest = nullptr;       // [frame][output][lane] and of the outputs
};

template <class T>
using DirectStep = void (*)(const Program& program, DirectState<T>& state, const Block<T>& block);

// The function for lanes that fill so many bytes.
template <Isa isa, class T>
DirectStep<T> direct_step(std::size_t bytes);

// The same with compensated positions.
template <Isa isa>
DirectStep<float> compensated_step(std::size_t bytes);

template <class T>
class DirectKernel final : public Kernel<T> {
 public:
  DirectKernel(const Program& program, const Direct& form, std::size_t voices, Isa isa);
  void set_state(std::size_t lane, const double* x, const double* v) override;
  bool save(std::size_t lane, double* x, double* v) const override;
  bool read(std::span<const std::uint32_t> nodes, T* x, T* v) const override;
  bool write_nodes(std::span<const std::uint32_t> nodes, const T* x, const T* v) override;
  bool is_near_start(std::size_t lane, double bound) const override;

 private:
  void play(const Block<T>& block) override;
  const Program& program_;
  DirectStep<T> step_;
  Aligned<T> x_;
  Aligned<T> v_;
  Aligned<T> force_;
  std::vector<Corners<T>> corners_;
  PassiveRoom<T> passive_;
};

}  // namespace ressort
