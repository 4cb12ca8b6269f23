// core/kernels: which instructions this machine has. Files named *_step.cpp are compiled once for
// each of these, into a namespace of that name; everything else is compiled for the base. What such
// a file offers is a function template over Isa, which the file specialises for its own.
#pragma once

#include <cstddef>
#include <string_view>

#include "core/rooms.h"

namespace ressort::kernels {

// What the build offers: RESSORT_LEAST_ISA, and wider ones with RESSORT_HAS_v3 and RESSORT_HAS_v4.
#ifndef RESSORT_LEAST_ISA
#define RESSORT_LEAST_ISA base
#endif

enum class Isa {
  base,  // every x86-64 (SSE2); every other machine, whatever it is
  v3,    // x86-64-v3: AVX2 and FMA
  v4,    // x86-64-v4: AVX-512
};

// Of one register.
constexpr std::size_t vector_bytes(Isa isa) {
  return isa == Isa::v4 ? 64 : isa == Isa::v3 ? 32 : 16;
}

bool has_isa(Isa isa);  // this machine and this build. [any thread]
Isa best_isa();         // the widest that they have. [any thread]
std::string_view isa_name(Isa isa);

// Of the packs that this machine works on whole. [any thread]
std::size_t whole_pack_bytes(Isa isa);

// Code for narrow registers runs several times slower while the upper halves of wide ones are in
// use, and compilers do not always clear those on the way out. [audio]
void clear_wide_registers();

// What `make.operator()<Isa>()` gives, called with the instruction set, if the build has it.
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

// What `make.operator()<bytes>()` gives, called with the width of packs: one that such a file is
// compiled for, from the `widest` by halves to the `least`.
template <std::size_t widest, std::size_t least = 16, class Make>
static inline auto with_bytes(std::size_t bytes, const Make& make) {
  if constexpr (widest > least) {
    if (bytes != widest) {
      return with_bytes<widest / 2, least>(bytes, make);
    }
  }
  return make.template operator()<widest>();
}

// Of the narrowest register that holds the voices, or of the widest that there is.
template <class T>
constexpr std::size_t lanes_for(std::size_t voices, Isa isa) {
  std::size_t bytes = 16;
  while (bytes < vector_bytes(isa) && bytes / sizeof(T) < voices) {
    bytes *= 2;
  }
  return bytes / sizeof(T);
}

}  // namespace ressort::kernels
