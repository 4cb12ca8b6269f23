// The direct form, compiled for each instruction set without fused multiply-adds: a render has the
// same bits on every machine.
#include "core/kernels/direct/direct_loops.h"

namespace ressort::kernels {

template <>
DirectLoops<float> direct_loops<Isa::RESSORT_ISA, float>(std::size_t bytes) {
  return RESSORT_ISA::loops_for<float>(bytes);
}

template <>
DirectLoops<double> direct_loops<Isa::RESSORT_ISA, double>(std::size_t bytes) {
  return RESSORT_ISA::loops_for<double>(bytes);
}

}  // namespace ressort::kernels
