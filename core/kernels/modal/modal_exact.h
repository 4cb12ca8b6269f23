// core/kernels: exact discretisation of modes (Modes::is_exact). A part of modal_step.cpp.
//
// The samples of q'' + Z q' + K q = F are a mode of the published scheme with r = e^(-Z/2) and
// w^2 = K - Z^2/4:  lZ = 1 - r^2,  lK = 1 + r^2 - 2 r cos w. The force is multiplied by the gain
// lK/K, which gives the exact displacement at rest (Gautschi, Numerische Mathematik 3, 1961). All
// of these are smooth functions of K and Z, for oscillating and for overdamped modes. Shapes and q
// are scaled by the square root of the gain, so that it acts once where a force enters and once
// where a displacement is read.
#pragma once

#include "core/kernels/modal/modal_form.h"
#include "core/kernels/modal/modal_sweep.h"
#include "core/sampled_mode.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

constexpr double most_damping = 8.0;  // Z from which on a mode decays within a sample
constexpr double least_share = 1e-6;  // K per Z^2 below which the mode is overdamped

template <class V>
V lesser(V a, double most) {
  using T = Scalar<V>;
  return select(a < V{} + T(most), a, V{} + T(most));
}

// Returns (2 - 2 cos sqrt(u)) / u by its Taylor series.
template <class V>
V ripple(V u) {
  using T = Scalar<V>;
  V sum = V{} + 1;
#pragma GCC unroll 16
  for (int n = 14; n > 0; --n) {
    sum = 1 - T(1.0 / ((2 * n + 1) * (2 * n + 2))) * u * sum;
  }
  return sum;
}

// Returns 1 - e^-x for x up to 1, by its Taylor series.
template <class V>
V loss(V x) {
  using T = Scalar<V>;
  V sum = V{} + 1;
#pragma GCC unroll 20
  for (int n = 18; n > 1; --n) {
    sum = 1 - T(1.0 / n) * x * sum;
  }
  return x * sum;
}

// Replaces K and Z by lK and lZ. Returns the gain of the force.
template <class V>
V make_exact(V& k, V& z) {
  using T = Scalar<V>;
  const V damping = lesser(z, most_damping);
  const V eighth = loss(damping / 8);
  const V quarter = eighth * (2 - eighth);
  const V half = quarter * (2 - quarter);
  const V lost = half * (2 - half);
  const V creep = -damping * damping / 4;
  const V ring = lesser(k + creep, nyquist_ring);
  const V stiffness = (1 - half) * (ring * ripple(ring) - creep * ripple(creep));
  const V creeping = select(damping > V{}, lost / damping, V{} + 1);
  const auto rings = k > T(least_share) * damping * damping;
  const V over = (ring - T(highest_ring)) / T(nyquist_ring - highest_ring);
  const V left_out = select(over > V{}, over, V{});
  const V felt = stiffness + left_out * (1 - stiffness);
  const V gain = select(rings, felt / k, creeping);
  k = select(rings, felt, creeping * k);
  z = lost + left_out * (1 - lost);
  return gain;
}

// Does this for all modes, and scales shapes and states by the root of the gain.
template <class T>
void make_exact(ModalState<T>& s, std::size_t shapes, T* k, T* z) {
  using V = ModePack<T>;
  for (std::size_t i = 0; i < all_packs(s); ++i) {
    const V gain = make_exact(packs(k)[i], packs(z)[i]);
    V root = gain;
    for (std::size_t lane = 0; lane < mode_lanes<T>; ++lane) {
      root[lane] = std::sqrt(gain[lane]);
    }
    const V change = packs(s.motion.root)[i] / root;
    packs(s.motion.root)[i] = root;
    packs(s.motion.q)[i] *= change;
    packs(s.motion.d)[i] *= change;
    packs(s.sleep.debt)[i] *= change;
  }
  for (std::size_t row = 0; row < shapes; ++row) {
    const V* const shape = packs(s.shapes.unscaled + row * s.shapes.stride);
    V* const scaled = packs(s.shapes.pushes + row * s.shapes.stride);
    for (std::size_t i = 0; i < all_packs(s); ++i) {
      scaled[i] = shape[i] * packs(s.motion.root)[i];
    }
  }
  s.sweep.bundled_modes = 0;
  s.passive.is_reply_stale = true;
}

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA
