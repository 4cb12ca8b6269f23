// core/engine: masses that are struck by themselves, without an input.
#pragma once

#include <algorithm>
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
inline std::vector<StruckMass> find_struck(const Machine& machine) {
  std::vector<StruckMass> struck;
  for (std::uint32_t p = 0; p < machine.parts.size(); ++p) {
    const Program& program = machine.parts[p];
    for (const MassRun& run : program.mass_runs) {
      for (std::uint32_t i = 0; i < run.count && !run.is_junction; ++i) {
        const std::uint32_t node = run.first + i;
        const std::size_t mass = program.masses[node];
        struck.resize(std::max(struck.size(), mass + 1));
        struck[mass] = {p, node, run.inverse_mass};
      }
    }
  }
  return struck;
}

}  // namespace ressort
