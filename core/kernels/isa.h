// core/kernels: the instruction sets of this machine. Files named *_step.cpp are compiled once for
// each of them, into a namespace of that name. All other files are compiled for the base. Such a
// file specialises a function template over Isa.
#pragma once

#include <cstddef>
#include <string_view>

#include "core/rooms.h"

namespace ressort::kernels {

// The build has RESSORT_LEAST_ISA, and wider sets if RESSORT_HAS_v3 and RESSORT_HAS_v4 are defined.
#ifndef RESSORT_LEAST_ISA
#define RESSORT_LEAST_ISA base
#endif

enum class Isa {
  base,  // every x86-64 (SSE2), and all other processors
  v3,    // x86-64-v3: AVX2 and FMA
  v4,    // x86-64-v4: AVX-512
};

// Width of a register.
constexpr std::size_t vector_bytes(Isa isa) {
  return isa == Isa::v4 ? 64 : isa == Isa::v3 ? 32 : 16;
}

// Returns whether this machine and this build have the set. [any thread]
bool has_isa(Isa isa);
// Returns the widest set that they have. [any thread]
Isa best_isa();
std::string_view isa_name(Isa isa);

// Returns the width of packs that this machine processes in one operation. [any thread]
std::size_t whole_pack_bytes(Isa isa);

// Clears the upper halves of wide registers (vzeroupper). Code for narrow registers runs several
// times slower while they are in use, and compilers do not always clear them. [audio]
void clear_wide_registers();

// Returns `make.operator()<isa>()`, or that of the least set if the build does not have `isa`.
// [any thread]
template <class Make>
auto with_isa(Isa isa, const Make& make) {
#ifdef RESSORT_HAS_v4
  if (isa == Isa::v4) {
    return make.template operator()<Isa::v4>();
  }
#endif
#ifdef RESSORT_HAS_v3
  if (isa == Isa::v3) {
    return make.template operator()<Isa::v3>();
  }
#endif
  static_cast<void>(isa);
  return make.template operator()<Isa::RESSORT_LEAST_ISA>();
}

// Returns `make.operator()<bytes>()`, where `bytes` is a pack width: `widest` or a half of it, a
// quarter and so on down to `least`.
template <std::size_t widest, std::size_t least = 16, class Make>
static inline auto with_bytes(std::size_t bytes, const Make& make) {
  if constexpr (widest > least) {
    if (bytes != widest) {
      return with_bytes<widest / 2, least>(bytes, make);
    }
  }
  return make.template operator()<widest>();
}

// Returns the lanes of the narrowest register that holds all voices, or of the widest register.
template <class T>
constexpr std::size_t lanes_for(std::size_t voices, Isa isa) {
  std::size_t bytes = 16;
  while (bytes < vector_bytes(isa) && bytes / sizeof(T) < voices) {
    bytes *= 2;
  }
  return bytes / sizeof(T);
}

}  // namespace ressort::kernels
