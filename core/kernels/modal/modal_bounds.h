// core/kernels: bounds on the motion of the modes by their energy, and whether a link can act
// within them. A part of modal_step.cpp.
//
// The discrete energy of a mode, m d^2 + lK (q - d/2)^2 with m = 1 - lZ/2 - lK/4, never grows
// without a force. It bounds q^2 by the energy times 1/lK + 1/(4m). A soft mode may drift: for it
// q^2 is added to the energy, and its velocity bounds its way in a block. The square root of the
// energy is a norm, so the contributions of pushes add up (triangle inequality).
#pragma once

#include <limits>

#include "core/kernels/modal/modal_sweep.h"
#include "core/laws/law.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

constexpr double least_stiffness = 1e-4;  // lK from which on a mode is not soft
constexpr double least_mass = 0.01;       // m, below which there is no bound
constexpr double drift_frames = static_cast<double>(max_block_frames);

template <class T>
struct Range {
  T low;
  T high;

  void take(T x) {
    low = low > x ? x : low;
    high = x > high ? x : high;
  }
};

// Computes the largest square of each place's displacement for an energy of 1. Returns false if the
// modes may gain energy by themselves.
template <class T>
bool measure_compliance(ModalState<T>& s, std::size_t places) {
  for (std::size_t p = 0; p < places; ++p) {
    s.ends.compliance[p] = 0;
  }
  for (std::size_t i = 0; i < s.shapes.modes; ++i) {
    const T k = s.motion.k[i];
    const T m = 1 - s.motion.z[i] / 2 - k / 4;
    if (!(k >= 0 && s.motion.z[i] >= 0 && m > T(least_mass))) {
      return false;
    }
    const T drift = T(drift_frames) * (1 + 1 / m);
    const T square = T(least_stiffness) > k ? drift * drift : 1 / k + 1 / (4 * m);
    for (std::size_t p = 0; p < places; ++p) {
      const T shape = s.shapes.places[p * s.shapes.row + i];
      s.ends.compliance[p] += shape * shape * square;
    }
  }
  return true;
}

template <class T>
T energy(const ModalState<T>& s) {
  using V = ModePack<T>;
  V sum{};
  for (std::size_t i = 0; i < pack_count(s); ++i) {
    const V k = packs(s.motion.k)[i];
    const V q = packs(s.motion.q)[i];
    const V d = packs(s.motion.d)[i];
    const V m = 1 - packs(s.motion.z)[i] / 2 - k / 4;
    const V middle = q - d / 2;
    const V soft =
        select(k < V{} + T(least_stiffness), V{} + T(1 / (drift_frames * drift_frames)), V{});
    sum += m * d * d + k * middle * middle + soft * q * q;
  }
  return total<T>(sum);
}

// Returns the growth of the norm by kicks that add up to `sum`, along a row of this length.
template <class T>
T norm_of_kicks(T sum, T length) {
  return T(1.001) * sum * length;  // with a margin for soft modes and rounding
}

// Returns whether a link may exert a force while its distance is in a range.
template <class T>
bool may_act(const LinkRun& run, const T* coefficients, Range<T> d) {
  const auto c = [&](std::size_t i) { return coefficients[run.coefficients[i]]; };
  const LawFacts& law = facts_of(run.law);
  bool exerts = false;
  for (std::size_t i = 0; i < law.count; ++i) {
    exerts = exerts || (law.is_strength(i) && c(i) != 0);
  }
  if (!law.can_detach()) {
    return exerts;
  }
  const T reach = c(law.slot(Role::reach));
  return exerts && d.high > -reach && (law.zone == Zone::below || reach > d.low);
}

inline bool can_detach(Law law) {
  return facts_of(law).can_detach();
}

// Returns the share of a link's force that remains with a compliance in series. For a curved law
// its secant is used. Friction has no stiffness and is not reduced.
template <class T, class ForceLaw>
T compliance_share(const ForceLaw& law, T d, T give) {
  const T stiffness = law.secant(d);
  return give > 0 && stiffness > 0 ? 1 / (1 + give * stiffness) : T(1);
}

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA
