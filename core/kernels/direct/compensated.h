// core/kernels: the direct form in single precision, with positions that are sums of two numbers.
// What small motions far from 0 lose in single precision, by gravity, an offset or a drift, they
// keep. From outside it is a kernel of T, which may be double: what goes in and comes out is not
// rounded to one number on its way.
#pragma once

#include "core/kernels/direct/direct.h"

namespace ressort::kernels {

template <class T>
class CompensatedKernel final : public NodeKernel<T, float> {
 public:
  CompensatedKernel(const Program& program, const Compensated& form, std::size_t voices, Isa isa);
  bool become(const Kernel<T>& from) override {
    this->become_nodes(from);
    return true;
  }

 private:
  void play(const Block<T>& block) override;
  bool keeps_forces() const override { return true; }

  DirectLoops<float> loops_;
  // The coefficients, and what a block says, in single precision.
  Aligned<float> coefficient_, increment_, target_;
  Aligned<float> value_, value_rest_, velocity_, audio_, outputs_, output_rest_;
};

}  // namespace ressort::kernels
