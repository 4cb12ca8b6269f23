#include "core/kernels/isa.h"

namespace ressort::kernels {

bool has_isa(Isa isa) {
#ifdef RESSORT_HAS_v4
  if (isa == Isa::v4) {
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
           __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512dq") &&
           __builtin_cpu_supports("avx512vl");
  }
#endif
#ifdef RESSORT_HAS_v3
  if (isa == Isa::v3) {
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
           __builtin_cpu_supports("bmi2");
  }
#endif
  return isa == Isa::RESSORT_LEAST_ISA;
}

Isa best_isa() {
  return has_isa(Isa::v4) ? Isa::v4 : has_isa(Isa::v3) ? Isa::v3 : Isa::RESSORT_LEAST_ISA;
}

#if defined(__x86_64__)
namespace {

const bool has_wide_registers = best_isa() != Isa::base;

__attribute__((target("avx"))) void clear() {
  __builtin_ia32_vzeroupper();
}

}  // namespace
#endif

void clear_wide_registers() {
#if defined(__x86_64__)
  if (has_wide_registers) {
    clear();
  }
#endif
}

std::size_t whole_pack_bytes(Isa isa) {
#if defined(__x86_64__)
  if (isa == Isa::v4 && __builtin_cpu_is("amdfam19h")) {
    return vector_bytes(Isa::v3);  // Zen 4 processes AVX-512 registers in two halves
  }
#endif
  return vector_bytes(isa);
}

std::string_view isa_name(Isa isa) {
  switch (isa) {
    case Isa::base:
      return "SSE2 or similar";
    case Isa::v3:
      return "AVX2";
    case Isa::v4:
      return "AVX-512";
  }
  return "";
}

}  // namespace ressort::kernels
