// core/engine: which instructions this machine has. Files named *_step.cpp are compiled once for
// each of these, into a namespace of that name; everything else is compiled for the base.
#pragma once

#include <cstddef>
#include <string_view>

namespace ressort {

enum class Isa {
  base,  // every x86-64 (SSE2); every other machine, whatever it is
  v3,    // x86-64-v3: AVX2 and FMA
  v4,    // x86-64-v4: AVX-512
};

Isa best_isa();  // of this machine. [any thread]
std::string_view isa_name(Isa isa);

// Code for narrow registers runs several times slower while the upper halves of wide ones are in
// use, and compilers do not always clear those on the way out. [audio]
void clear_wide_registers();

// Of one register.
constexpr std::size_t vector_bytes(Isa isa) {
  return isa == Isa::v4 ? 64 : isa == Isa::v3 ? 32 : 16;
}

}  // namespace ressort
