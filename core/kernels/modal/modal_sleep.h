// core/kernels: modes that are no longer heard; a part of modal_step.cpp, which alone includes it.
//
// A mode that is left alone rings as q = A r^n cos(...), with r^2 = 1 - lZ and
//   A^2 = (lK q^2 + (lZ - lK) q d + (1 - lZ) d^2) (1 - lZ) / (lK - (lK + lZ)^2 / 4),
// so that it never again moves a listener, an output or a place that links hold, by more than
// |shape| A. The loudness of an output is its peak, as it was heard until now. That of a place,
// which nobody hears, is what so many modes give it in the mean, the root of the sum of half the
// squares, now or lately. Both are forgotten as a room forgets in which a sound dies away in a
// second.
//
// Once in a while the modes are looked at from the one that dies first. As long as all that
// sleep can move no listener by more than the share `silence` of its loudness, the next one falls
// asleep: its state is dropped. What was dropped is owed: it goes on decaying in `debt`, awake or
// asleep, and counts in that sum. So the error at a listener is never more than its sum of |shape|
// debt. Whatever acts on the modes wakes all of them, in its own sample.
#pragma once

#include "core/kernels/modal/modal_sweep.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

// r^2 to this power is r^check_frames.
constexpr std::size_t check_doublings = 4;
static_assert(std::size_t{2} << check_doublings == check_frames);
constexpr std::size_t long_check_doublings = 2;
static_assert(check_frames << long_check_doublings == long_check_frames);
constexpr std::size_t few_modes = 16;

constexpr double least_ringing = 1e-4;  // share of lK; nearer to the aperiodic limit nothing sleeps
constexpr double endless = 1e15;        // the amplitude of what does not ring, for a state of 1

// What is left, after an interval as long as the last, of what a short one leaves `kept` of.
template <class V, class T>
V after_check(const ModalState<T>& s, V kept) {
  for (std::size_t i = 0; s.sleep.is_long_check && i < long_check_doublings; ++i) {
    kept *= kept;
  }
  return kept;
}

template <class T>
const T* listener(const ModalState<T>& s, std::size_t places, std::size_t l) {
  return l < places ? s.shapes.places + l * s.shapes.row
                    : s.shapes.outputs + (l - places) * s.shapes.row;
}

// How the modes ring, with the coefficients of now. Where a stiffness has fallen, what is owed
// swings wider.
template <class T>
void measure_ringing(ModalState<T>& s) {
  using V = ModePack<T>;
  for (std::size_t i = 0; i < all_packs(s); ++i) {
    const V k = packs(s.motion.k)[i];
    const V z = packs(s.motion.z)[i];
    const V left = 1 - z;
    const V half = (k + z) / 2;
    const V depth = k - half * half;
    const V spread = select(depth > T(least_ringing) * k, left / depth, V{});
    const V before = packs(s.sleep.spread)[i];
    const V wider = select(before > V{}, spread / before, V{} + 1);
    packs(s.sleep.spread)[i] = select(left > V{}, spread, V{});
    V decay = select(left > V{}, left, V{});
    for (std::size_t j = 0; j < check_doublings; ++j) {
      decay *= decay;
    }
    packs(s.sleep.decay)[i] = decay;
    for (std::size_t lane = 0; lane < mode_lanes<T>; ++lane) {
      s.sleep.debt[i * mode_lanes<T> + lane] *= wider[lane] > 1 ? std::sqrt(wider[lane]) : T(1);
    }
  }
}

template <class T>
void measure_amplitudes(ModalState<T>& s) {
  using V = ModePack<T>;
  for (std::size_t i = 0; i < pack_count(s); ++i) {
    const V k = packs(s.motion.k)[i];
    const V z = packs(s.motion.z)[i];
    const V q = packs(s.motion.q)[i];
    const V d = packs(s.motion.d)[i];
    const V square = (k * q * q + (z - k) * q * d + (1 - z) * d * d) * packs(s.sleep.spread)[i];
    const V state = T(endless) * (absolute(q) + absolute(d));
    for (std::size_t lane = 0; lane < mode_lanes<T>; ++lane) {
      s.sleep.amplitude[i * mode_lanes<T> + lane] =
          packs(s.sleep.spread)[i][lane] > 0 ? std::sqrt(square[lane] > 0 ? square[lane] : T(0))
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
    V loud{};
    for (std::size_t i = 0; l < places && i < pack_count(s); ++i) {
      const V part = packs(row)[i] * packs(s.sleep.amplitude)[i];
      loud += select(packs(s.sleep.spread)[i] > V{}, part * part, V{});
    }
    V owed{};
    for (std::size_t i = 0; i < all_packs(s); ++i) {
      owed += absolute(packs(row)[i]) * packs(s.sleep.debt)[i];
    }
    const T now = std::sqrt(total<T>(loud) / 2);
    const T lately = after_check(s, s.sleep.lately_kept) * s.sleep.loudness[l];
    s.sleep.loudness[l] = now > lately ? now : lately;
    // The peak without what sleeps may be less by what is missing.
    const T share = s.sleep.silence * (1 - s.sleep.silence);
    const T room = share * s.sleep.loudness[l] - total<T>(owed);
    s.sleep.room[l] = room > 0 ? room : T(0);
  }
}

template <class T>
bool may_sleep(ModalState<T>& s, std::size_t mode, std::size_t places, std::size_t listeners) {
  for (std::size_t l = 0; l < listeners; ++l) {
    if (absolute(listener(s, places, l)[mode]) * s.sleep.amplitude[mode] > s.sleep.room[l]) {
      return false;
    }
  }
  for (std::size_t l = 0; l < listeners; ++l) {
    s.sleep.room[l] -= absolute(listener(s, places, l)[mode]) * s.sleep.amplitude[mode];
  }
  return true;
}

template <class T>
void stay_awake(ModalState<T>& s, std::size_t modes) {
  const std::size_t unit = 2 * mode_lanes<T>;
  s.sleep.awake = modes;
  s.sleep.swept = (modes + unit - 1) / unit * unit;
}

// What has decayed enough falls asleep. The modes are left alone at this time.
template <class T>
void check_sleep(ModalState<T>& s, std::size_t places, std::size_t listeners) {
  for (std::size_t i = 0; i < all_packs(s); ++i) {
    packs(s.sleep.debt)[i] *= after_check(s, packs(s.sleep.decay)[i]);
  }
  measure_amplitudes(s);
  measure_room(s, places, listeners);
  std::size_t awake = s.sleep.awake;
  for (; awake > 0 && may_sleep(s, awake - 1, places, listeners); --awake) {
    const std::size_t mode = awake - 1;
    s.sleep.debt[mode] += s.sleep.amplitude[mode];
    s.motion.q[mode] = s.motion.d[mode] = s.saved.q[mode] = s.saved.d[mode] = 0;
  }
  stay_awake(s, awake);
  s.sleep.is_long_check = awake <= few_modes;
}

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA
