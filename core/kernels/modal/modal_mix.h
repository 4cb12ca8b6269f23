// core/kernels: what the coefficients make of the modes of a ModalState; a part of modal_step.cpp,
// which alone includes it.
#pragma once

#include "core/kernels/modal/modal_exact.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

template <class T, bool Crossed>
struct ModeMixer {
  static constexpr bool is_crossed = Crossed;
  const Modes& modes;
  ModalState<T>& s;

  T coefficient(std::uint32_t c) const { return s.ramps.value[c]; }
  T inverse_mass() const {
    return modes.inverse_mass == Modes::own_mass ? T(1) : coefficient(modes.inverse_mass);
  }

  // For how many samples from now on the modes are not what they were in the sample before.
  std::size_t moving_frames() const {
    if (s.ramps.frames > 0) {
      return s.ramps.frames;
    }
    const T* used = s.motion.used;
    bool is_same = true;
    for (const ModalShare& share : modes.stiffness) {
      is_same &= *used++ == coefficient(share.coefficient);
    }
    for (const ModalShare& share : modes.damping) {
      is_same &= *used++ == coefficient(share.coefficient);
    }
    return is_same && *used == inverse_mass() ? 0 : 1;
  }

  // A coefficient some samples from now.
  T coefficient(std::uint32_t c, std::size_t ahead) const {
    for (std::size_t i = 0; ahead > 0 && i < s.ramps.count; ++i) {
      if (s.ramps.ramping[i] == c) {
        return ahead < s.ramps.frames
                   ? s.ramps.value[c] + static_cast<T>(ahead) * s.ramps.increment[c]
                   : s.ramps.target[c];
      }
    }
    return coefficient(c);
  }

  // lK and lZ, some samples from now.
  void mix(std::size_t ahead, T* k, T* z) {
    const T w =
        modes.inverse_mass == Modes::own_mass ? T(1) : coefficient(modes.inverse_mass, ahead);
    if constexpr (Crossed) {
      // Placed a sample ahead, in the first one nothing moves them but what pushes.
      s.motion.is_first = *s.motion.used == 0;
      const T here = s.motion.is_first ? T(0) : T(1);
      for (std::size_t i = 0; i < all_packs(s); ++i) {
        packs(k)[i] = here * packs(s.shapes.pole)[i];
        packs(z)[i] = here * packs(s.shapes.pole + s.shapes.stride)[i];
      }
      *s.motion.used = w;
      return;
    }
    T* used = mix(modes.stiffness, s.shapes.stiffness, ahead, w, k, s.motion.used);
    used = mix(modes.damping, s.shapes.damping, ahead, w, z, used);
    *used = w;
    if (modes.is_exact) {
      make_exact(s, modes.pushes.size() + modes.places.size() + modes.outputs.size(), k, z);
    }
  }
  T* mix(const std::vector<ModalShare>& shares, const T* factors, std::size_t ahead, T w, T* out,
         T* used) {
    for (std::size_t i = 0; i < all_packs(s); ++i) {
      packs(out)[i] = ModePack<T>{};
    }
    for (std::size_t j = 0; j < shares.size(); ++j, ++used) {
      const std::uint32_t c = shares[j].coefficient;
      const T value = w * (!shares[j].is_late ? coefficient(c, ahead)
                           : ahead > 1        ? coefficient(c, ahead - 1)
                                              : *used);
      *used = coefficient(c, ahead);
      constexpr std::size_t lanes = mode_lanes<T>;
      const std::size_t first = shares[j].first / lanes;
      const std::size_t end = (shares[j].first + shares[j].factor.size() + lanes - 1) / lanes;
      for (std::size_t i = first; i < end; ++i, factors += lanes) {
        packs(out)[i] += value * *packs(factors);
      }
    }
    return used;
  }

  // The rows by which forces are felt, with the coefficients of now.
  void mix_forces() {
    std::size_t force = 0;
    for (const ModalOutput& output : modes.outputs) {
      if (!output.is_force) {
        continue;
      }
      T* const rows = s.forces.rows + 2 * force * s.shapes.stride;
      std::fill_n(rows, 2 * s.shapes.stride, T(0));
      T still = 0;
      for (const ModalForce::Part& part : output.force.parts) {
        const T c = coefficient(part.coefficient);
        // Of crossed modes both rows are the two parts of one, dampers by the speed's own shape.
        for (std::size_t i = 0; i < part.shape.size(); ++i) {
          const std::size_t mode = i % modes.modes;
          const bool is_second = Crossed ? i >= modes.modes : part.is_damping;
          const T root = modes.is_exact && !Crossed ? s.motion.root[mode] : T(1);
          rows[(is_second ? s.shapes.stride : 0) + mode] +=
              c * root * static_cast<T>(part.shape[i]);
        }
        still += c * static_cast<T>(part.constant);
      }
      s.forces.still[force++] = still;
    }
  }

  // Between here and some samples on exact coefficients move in a straight line: gives how many.
  // What has just been placed is pulled by nothing in its first sample.
  std::size_t begin_exact(std::size_t frames) {
    frames = s.motion.fresh_frames < 2 ? 1 : frames;
    s.motion.fresh_frames += s.motion.fresh_frames < 2;
    mix(frames, s.motion.k_step, s.motion.z_step);
    const T share = T(1) / static_cast<T>(frames);
    for (std::size_t i = 0; i < all_packs(s); ++i) {
      packs(s.motion.k_step)[i] = share * (packs(s.motion.k_step)[i] - packs(s.motion.k)[i]);
      packs(s.motion.z_step)[i] = share * (packs(s.motion.z_step)[i] - packs(s.motion.z)[i]);
    }
    return frames;
  }
  void advance_exact() {
    for (std::size_t i = 0; i < all_packs(s); ++i) {
      packs(s.motion.k)[i] += packs(s.motion.k_step)[i];
      packs(s.motion.z)[i] += packs(s.motion.z_step)[i];
    }
  }
};

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA
