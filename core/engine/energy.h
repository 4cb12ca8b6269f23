// core/engine: the energy of a Program's voice, in the form that the discrete scheme conserves.
//
//   E = 1/2 dT (M - Z/2) d + 1/2 x[n-1]T K x[n],  d = x[n] - x[n-1]
//
// For springs, dampers and oscillators the energy falls by the work of the dampers and rises by the
// work of external forces and driven positions, exactly but for rounding. A nonlinear law adds its
// potential, averaged over both positions, minus a quarter of d times the change of its force. For
// a linear law this equals the product of two successive elongations. For the discrete gradient
// scheme nothing is subtracted.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>

#include "core/kernels/program.h"

namespace ressort::engine {

// Unit: mass * (position per sample)^2, at the Program's rate.
struct Energy {
  double value = 0.0;
  double uncertainty = 0.0;  // greatest variation due to nonlinear laws of the plain scheme
  double scale = 0.0;        // sum of the magnitudes of all terms; rounding errors scale with it
};

// View of the coefficients of one lane: [coefficient * width + lane].
template <class T>
struct LaneValues {
  const T* value = nullptr;
  std::size_t width = 1;
  std::size_t lane = 0;
  double operator[](std::uint32_t c) const { return static_cast<double>(value[c * width + lane]); }
};

// Returns the energy. `x` and `v`: [node], from Kernel::save(). The gravity potential is 0 at
// position 0. [audio] wait-free, O(nodes + links)
template <class T>
Energy energy_of(const Program& program, LaneValues<T> coefficients, const double* x,
                 const double* v);

// Adds the energy of the elements [first, end): nodes, then links. [audio] wait-free
template <class T>
void add_energy(const Program& program, LaneValues<T> coefficients, const double* x,
                const double* v, std::size_t first, std::size_t end, Energy& energy);

// Returns whether all masses come to rest at 0, apart from the effect of contacts, plucks and bows.
// False with gravity, and with springs to fixed points away from 0. [audio] wait-free, O(links)
template <class T>
bool rests_at_zero(const Program& program, LaneValues<T> coefficients, const double* x);

// Returns the gap of a contact or a pluck when all masses are at 0; not positive if the law acts
// there. [audio] wait-free, O(link runs)
template <class T>
double gap_at_rest(const Program& program, LaneValues<T> coefficients, const double* x,
                   std::uint32_t link);

}  // namespace ressort::engine
