// core/engine: the published scheme in single precision, with positions that are sums of two
// numbers (direct.h). What small motions far from 0 lose in single precision, by gravity, an offset
// or a drift, they keep. From outside it is a kernel of T, which may be double: what goes in and
// comes out is not rounded to one number on its way.
#pragma once

#include "core/kernels/direct/direct.h"

namespace ressort {

template <class T>
class CompensatedKernel final : public Kernel<T> {
 public:
  CompensatedKernel(const Program& program, const Compensated& form, std::size_t voices, Isa isa);
  void set_state(std::size_t lane, const double* x, const double* v) override;
  bool save(std::size_t lane, double* x, double* v) const override;
  bool is_near_start(std::size_t lane, double bound) const override;

 private:
  void play(const Block<T>& block) override;
  double position(std::size_t at) const;

  const Program& program_;
  DirectStep<float> step_;
  Aligned<float> x_;
  Aligned<float> rest_;
  Aligned<float> v_;
  Aligned<float> force_;
  std::vector<Corners<float>> corners_;
  // The coefficients, and what a block says, in single precision.
  Aligned<float> coefficient_, increment_, target_;
  PassiveRoom<float> passive_;
  Aligned<float> value_, value_rest_, velocity_, audio_, outputs_, output_rest_;
};

}  // namespace ressort
