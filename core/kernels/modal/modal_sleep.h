// core/kernels: modes that are no longer audible sleep. A part of modal_step.cpp.
//
// A free mode rings as q = A r^n cos(...), with r^2 = 1 - lZ and
//   A^2 = (lK q^2 + (lZ - lK) q d + (1 - lZ) d^2) (1 - lZ) / (lK - (lK + lZ)^2 / 4),
// so it never again moves a listener (an output, or a place that links hold) by more than |shape|
// A. The loudness of an output is its peak until now. The loudness of a place, which is no output,
// is the RMS value of its modes, the root of the sum of half the squares, now or lately. Both decay
// by 60 dB per second.
//
// The modes are checked at intervals, the one that decays fastest first. A mode falls asleep, and
// its state is set to 0, as long as all dropped modes together cannot move any listener by more
// than the share `silence` of its loudness. The amplitude that was dropped stays in `debt` and
// decays there, whether the mode sleeps or not. So the error at a listener never exceeds its sum of
// |shape| debt. Every force on the modes wakes all of them in the same sample.
#pragma once

#include "core/kernels/modal/modal_sweep.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

// Squaring r^2 this many times gives r^check_frames.
constexpr std::size_t check_doublings = 7;
static_assert(std::size_t{2} << check_doublings == check_frames);

constexpr double least_ringing = 1e-4;  // share of lK; modes nearer to critical damping never sleep
constexpr double endless = 1e15;        // amplitude of a mode that does not ring, for a state of 1

template <class T>
const T* listener(const ModalState<T>& s, std::size_t places, std::size_t l) {
  return l < places ? s.shapes.places + l * s.shapes.row
                    : s.shapes.outputs + (l - places) * s.shapes.row;
}

// Updates the ringing of the modes from the current coefficients. If a stiffness has fallen, the
// amplitudes in `debt` grow.
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

// Computes the amplitude that may still be dropped at each listener.
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
    const T lately = s.sleep.lately_kept * s.sleep.loudness[l];
    s.sleep.loudness[l] = now > lately ? now : lately;
    // The measured peak may be too small by the share that sleeps.
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

// Puts modes to sleep that have decayed enough. No force may act on the modes at this time.
template <class T>
void check_sleep(ModalState<T>& s, std::size_t places, std::size_t listeners) {
  for (std::size_t i = 0; i < all_packs(s); ++i) {
    packs(s.sleep.debt)[i] *= packs(s.sleep.decay)[i];
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
}

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA
