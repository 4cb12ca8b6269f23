#include "core/engine/struck.h"

#include <algorithm>

namespace ressort {

std::vector<StruckMass> find_struck(const Machine& machine) {
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
