// core/engine: the continuous network to fourth order in time, where the published scheme has
// second order, and first in the dampers. One voice in each lane, as in the direct kernel.
//
// Between two samples a mass is not where it was and not as fast. With a = F/M, all that acts on it
// by the published laws, springs and dampers pull as if it were at x + a_s/12 with velocity v +
// a/2,
//   F = -K (x + a_s/12) - Z (v + a/2),  v += F/M, x += v,
// a_s being without the dampers' share: v is the velocity half a sample ago, and 1/12 is what the
// second difference of a motion has too much. So there is a second pass over the linear links.
//
// What other links and force inputs exert is as published itself, and counts in a: a force f that
// lasts moves the network as far as (I - K/12M) f moves the scheme, which is where the continuous
// network goes. Position inputs count as they are given.
#pragma once

#include "core/kernels/kernel.h"
#include "core/kernels/taps.h"

namespace ressort {

// Everything that one step of FourthKernel touches.
template <class T>
struct FourthState {
  Ramps<T> ramps;
  T* x;                 // [node][lane] position
  T* v;                 // [node][lane] change of position per sample
  T* force;             // [node][lane] summed by the links, used by the next sample
  T* damping;           // [node][lane] the linear dampers' share of it
  T* ahead;             // [node][lane] a_s/12; 0 where nothing moves
  T* faster;            // [node][lane] a/2; 0 where nothing moves
  Corners<T>* corners;  // [tap][lane] in this sample
  std::size_t nodes;
};

template <class T>
using FourthStep = void (*)(const Program& program, const Fourth& form, FourthState<T>& state,
                            const Block<T>& block);

// The function for lanes that fill so many bytes.
template <Isa isa, class T>
FourthStep<T> fourth_step(std::size_t bytes);

template <class T>
class FourthKernel final : public Kernel<T> {
 public:
  FourthKernel(const Program& program, const Fourth& form, std::size_t voices, Isa isa);
  void set_state(std::size_t lane, const double* x, const double* v) override;
  bool save(std::size_t lane, double* x, double* v) const override;
  bool is_near_start(std::size_t lane, double bound) const override;

 private:
  void play(const Block<T>& block) override;
  const Program& program_;
  const Fourth& form_;
  FourthStep<T> step_;
  Aligned<T> x_;
  Aligned<T> v_;
  Aligned<T> force_;
  Aligned<T> damping_;
  Aligned<T> ahead_;
  Aligned<T> faster_;
  std::vector<Corners<T>> corners_;
};

}  // namespace ressort
