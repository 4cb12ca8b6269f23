// core/engine: the energy of a Program's voice, as the discrete scheme itself conserves it.
//
//   E = 1/2 dT (M - Z/2) d + 1/2 x[n-1]T K x[n],  d = x[n] - x[n-1]
//
// With springs, dampers and oscillators it falls by exactly what the dampers take, to rounding, and
// rises by exactly what forces and hands do. A bent law adds its potential, averaged over both
// positions, less a quarter of d times the change of its force: with a straight law that is the
// same product of two elongations. With the discrete gradient nothing is subtracted.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>

#include "core/kernels/program.h"

namespace ressort::engine {

// In units of mass * (position per sample)^2, at the Program's rate.
struct Energy {
  double value = 0.0;
  double doubt = 0.0;  // by how much bent laws of the plain scheme may have it differ as they move
  double scale = 0.0;  // its terms' magnitudes added: what rounding is a share of
};

// The coefficients of one lane: [coefficient * width + lane].
template <class T>
struct LaneValues {
  const T* value = nullptr;
  std::size_t width = 1;
  std::size_t lane = 0;
  double operator[](std::uint32_t c) const { return static_cast<double>(value[c * width + lane]); }
};

// `x` and `v`: [node], as Kernel::save gives them. What only gravity pulls has its potential above
// 0. [audio] wait-free, O(nodes + links)
template <class T>
Energy energy_of(const Program& program, LaneValues<T> coefficients, const double* x,
                 const double* v);

// The same of the elements [first, end) alone, added: nodes, then links. [audio] wait-free
template <class T>
void add_energy(const Program& program, LaneValues<T> coefficients, const double* x,
                const double* v, std::size_t first, std::size_t end, Energy& energy);

// Does everything that moves come to rest at 0, but for what contacts, plucks and bows may do? Not
// with gravity, nor where something that stands elsewhere pulls. [audio] wait-free, O(links)
template <class T>
bool rests_at_zero(const Program& program, LaneValues<T> coefficients, const double* x);

// How far the ends of a contact or a pluck are from acting on each other when all that moves is at
// 0; not positive where they act. [audio] wait-free, O(link runs)
template <class T>
double distance_at_rest(const Program& program, LaneValues<T> coefficients, const double* x,
                        std::uint32_t link);

}  // namespace ressort::engine
