// core/engine: modes that are no longer heard; a part of modal_step.cpp, which alone includes it.
//
// A mode that is left alone rings as q = A r^n cos(...), with r^2 = 1 - lZ and
//   A^2 = (lK q^2 + (lZ - lK) q d + (1 - lZ) d^2) (1 - lZ) / (lK - (lK + lZ)^2 / 4),
// so that it never again moves a listener, an output or a place that links hold, by more than
// |shape| A. Once in nap_frames the modes are looked at from the one that dies first. As long as
// the sum of |shape| A of all that sleep stays below the share `silence` of the loudest mode of now
// or lately (it is forgotten by 60 dB in 0.2 s, sooner than by the ear), at every listener, the
// next one falls asleep: its state is dropped. What was dropped is owed: it goes on decaying in
// `debt` until it is nothing, awake or asleep, and counts in that sum. So at any time the error at
// a listener is at most the sum of |shape| debt.
//
// Whatever acts on the modes wakes all of them, in its own sample.
#pragma once

#include "core/engine/modal_sweep.h"

namespace ressort::RESSORT_ISA {
namespace {

// r^2 to this power is r^nap_frames.
constexpr std::size_t nap_doublings = 7;
static_assert(std::size_t{2} << nap_doublings == nap_frames);

constexpr double least_ringing = 1e-4;  // share of lK; nearer to the aperiodic limit nothing sleeps
constexpr double endless = 1e15;        // the amplitude of what does not ring, for a state of 1

template <class T>
const T* listener(const ModalState<T>& s, std::size_t places, std::size_t l) {
  return l < places ? s.places + l * s.stride : s.outputs + (l - places) * s.stride;
}

// How the modes ring, with the coefficients of now. Where a stiffness has fallen, what is owed
// swings wider.
template <class T>
void measure_ringing(ModalState<T>& s) {
  using V = ModePack<T>;
  for (std::size_t i = 0; i < all_packs(s); ++i) {
    const V k = packs(s.k)[i];
    const V z = packs(s.z)[i];
    const V left = 1 - z;
    const V half = (k + z) / 2;
    const V depth = k - half * half;
    const V spread = select(depth > T(least_ringing) * k, left / depth, V{});
    const V before = packs(s.spread)[i];
    const V wider = select(before > V{}, spread / before, V{} + 1);
    packs(s.spread)[i] = select(left > V{}, spread, V{});
    V decay = select(left > V{}, left, V{});
    for (std::size_t j = 0; j < nap_doublings; ++j) {
      decay *= decay;
    }
    packs(s.decay)[i] = decay;
    for (std::size_t lane = 0; lane < mode_lanes<T>; ++lane) {
      s.debt[i * mode_lanes<T> + lane] *= wider[lane] > 1 ? std::sqrt(wider[lane]) : T(1);
    }
  }
}

template <class T>
void measure_amplitudes(ModalState<T>& s) {
  using V = ModePack<T>;
  for (std::size_t i = 0; i < pack_count(s); ++i) {
    const V k = packs(s.k)[i];
    const V z = packs(s.z)[i];
    const V q = packs(s.q)[i];
    const V d = packs(s.d)[i];
    const V square = (k * q * q + (z - k) * q * d + (1 - z) * d * d) * packs(s.spread)[i];
    const V state = T(endless) * (absolute(q) + absolute(d));
    for (std::size_t lane = 0; lane < mode_lanes<T>; ++lane) {
      s.swing[i * mode_lanes<T> + lane] = packs(s.spread)[i][lane] > 0
                                              ? std::sqrt(square[lane] > 0 ? square[lane] : T(0))
                                              : state[lane];
    }
  }
}

// What may still be dropped at each listener.
template <class T>
void measure_room(ModalState<T>& s, std::size_t places, std::size_t listeners) {
  using V = ModePack<T>;
  for (std::size_t l = 0; l < listeners; ++l) {
    const T* const row = listener(s, places, l);
    V loudest{};
    for (std::size_t i = 0; i < pack_count(s); ++i) {
      const V part = absolute(packs(row)[i]) * packs(s.swing)[i];
      loudest = select(part > loudest, part, loudest);
    }
    V owed{};
    for (std::size_t i = 0; i < all_packs(s); ++i) {
      owed += absolute(packs(row)[i]) * packs(s.debt)[i];
    }
    T most = s.lately_kept * s.loudest[l];
    for (std::size_t lane = 0; lane < mode_lanes<T>; ++lane) {
      most = loudest[lane] > most ? loudest[lane] : most;
    }
    s.loudest[l] = most;
    const T room = s.silence * most + s.quiet - total<T>(owed);
    s.room[l] = room > 0 ? room : T(0);
  }
}

template <class T>
bool may_sleep(ModalState<T>& s, std::size_t mode, std::size_t places, std::size_t listeners) {
  for (std::size_t l = 0; l < listeners; ++l) {
    if (absolute(listener(s, places, l)[mode]) * s.swing[mode] > s.room[l]) {
      return false;
    }
  }
  for (std::size_t l = 0; l < listeners; ++l) {
    s.room[l] -= absolute(listener(s, places, l)[mode]) * s.swing[mode];
  }
  return true;
}

template <class T>
void stay_awake(ModalState<T>& s, std::size_t modes) {
  const std::size_t unit = 2 * mode_lanes<T>;
  s.awake = modes;
  s.swept = (modes + unit - 1) / unit * unit;
}

// What has decayed enough falls asleep. The modes are left alone at this time.
template <class T>
void nap(ModalState<T>& s, std::size_t places, std::size_t listeners) {
  for (std::size_t i = 0; i < all_packs(s); ++i) {
    packs(s.debt)[i] *= packs(s.decay)[i];
  }
  measure_amplitudes(s);
  measure_room(s, places, listeners);
  std::size_t awake = s.awake;
  for (; awake > 0 && may_sleep(s, awake - 1, places, listeners); --awake) {
    const std::size_t mode = awake - 1;
    s.debt[mode] += s.swing[mode];
    s.q[mode] = s.d[mode] = s.saved_q[mode] = s.saved_d[mode] = 0;
  }
  stay_awake(s, awake);
}

}  // namespace
}  // namespace ressort::RESSORT_ISA
