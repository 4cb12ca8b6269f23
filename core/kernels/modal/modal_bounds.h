// core/kernels: bounds on the motion of the modes by their energy, and whether a link can act
// within them. A part of modal_step.cpp.
//
// The discrete energy of a mode, m d^2 + lK (q - d/2)^2 with m = 1 - lZ/2 - lK/4, never grows
// without a force. It bounds q^2 by the energy times 1/lK + 1/(4m), and d^2 by the energy over m.
// The root of the ringing modes' total energy is a norm, so the contributions of pushes add up
// (triangle inequality). A soft mode may drift far, such as a hammer that has left its string. Its
// displacement is known and its speed is bounded, so it is bounded alone.
#pragma once

#include <algorithm>
#include <cmath>

#include "core/kernels/modal/modal_sweep.h"
#include "core/laws/law.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

constexpr double least_stiffness = 1e-4;  // lK from which on a mode is not soft
constexpr double least_mass = 0.01;       // m, below which there is no bound
constexpr double least_soft_mass = 0.5;   // the same for a soft mode
constexpr double drift_frames = static_cast<double>(max_block_frames + 2);

template <class T>
struct Range {
  T low;
  T high;

  void take(T x) {
    low = low > x ? x : low;
    high = x > high ? x : high;
  }
};

// Finds the soft modes, and the largest square of each place's displacement by the other modes for
// an energy of 1. Returns false if the modes may gain energy by themselves.
template <class T>
bool measure_compliance(ModalState<T>& s, std::uint32_t modes, std::size_t places) {
  std::fill_n(s.ends.compliance, places, T(0));
  s.ends.soft_modes = 0;
  for (std::uint32_t i = 0; i < modes; ++i) {
    const T k = s.motion.k[i];
    const T m = 1 - s.motion.z[i] / 2 - k / 4;
    const bool is_soft = k < T(least_stiffness);
    if (!(k >= 0 && s.motion.z[i] >= 0 && m > T(is_soft ? least_soft_mass : least_mass))) {
      return false;
    }
    if (is_soft) {
      s.ends.soft[s.ends.soft_modes++] = i;
      continue;
    }
    for (std::size_t p = 0; p < places; ++p) {
      const T shape = s.shapes.places[p * s.shapes.row + i];
      s.ends.compliance[p] += shape * shape * (1 / k + 1 / (4 * m));
    }
  }
  return true;
}

// Returns the energy of the modes that are not soft.
template <class T>
T ringing_energy(const ModalState<T>& s) {
  using V = ModePack<T>;
  V sum{};
  for (std::size_t i = 0; i < pack_count(s); ++i) {
    const V k = packs(s.motion.k)[i];
    const V q = packs(s.motion.q)[i];
    const V d = packs(s.motion.d)[i];
    const V m = 1 - packs(s.motion.z)[i] / 2 - k / 4;
    const V middle = q - d / 2;
    sum += select(k < V{} + T(least_stiffness), V{}, m * d * d + k * middle * middle);
  }
  return total<T>(sum);
}

// Computes the largest speeds of the soft modes without a force. Returns their sum.
template <class T>
T measure_soft_speeds(ModalState<T>& s) {
  T sum = 0;
  for (std::size_t j = 0; j < s.ends.soft_modes; ++j) {
    const std::size_t i = s.ends.soft[j];
    const T k = s.motion.k[i];
    const T m = 1 - s.motion.z[i] / 2 - k / 4;
    const T middle = s.motion.q[i] - s.motion.d[i] / 2;
    s.ends.soft_speed[j] = std::sqrt(s.motion.d[i] * s.motion.d[i] + k / m * middle * middle);
    sum += s.ends.soft_speed[j];
  }
  return sum;
}

// Returns the range of a place's displacement in a block, for a norm of the ringing modes and a
// growth of each norm by kicks.
template <class T>
Range<T> displacement_of(const ModalState<T>& s, std::size_t place, T norm, T kicks) {
  const T* const shape = s.shapes.places + place * s.shapes.row;
  T here = 0;
  T reach = (norm + kicks) * std::sqrt(s.ends.compliance[place]);
  for (std::size_t j = 0; j < s.ends.soft_modes; ++j) {
    const std::size_t i = s.ends.soft[j];
    here += shape[i] * s.motion.q[i];
    reach += T(drift_frames) * std::fabs(shape[i]) * (s.ends.soft_speed[j] + T(1.001) * kicks);
  }
  reach *= T(1.001);
  return {here - reach, here + reach};
}

// Returns the growth of the norm by kicks that add up to `sum`, along a row of this length.
template <class T>
T norm_of_kicks(T sum, T length) {
  return T(1.001) * sum * length;  // with a margin for rounding
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
