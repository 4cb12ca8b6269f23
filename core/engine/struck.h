// core/engine: masses that are struck by themselves, without an input.
#pragma once

#include <cstdint>
#include <vector>

#include "core/kernels/program.h"

namespace ressort {

struct StruckMass {
  static constexpr std::uint32_t nowhere = 0xffffffffu;
  std::uint32_t part = nowhere;
  std::uint32_t node = 0;
  std::uint32_t inverse_mass = 0;  // coefficient
};

// Where each mass of the network with its macros written out is in the machine; nowhere if it does
// not move, or was culled. [any thread but audio]
std::vector<StruckMass> find_struck(const Machine& machine);

}  // namespace ressort
