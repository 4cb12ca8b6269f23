// core/kernels: the passes over all modes of a ModalState. A part of modal_step.cpp.
#pragma once

#include <utility>

#include "core/kernels/modal/modal.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

constexpr std::size_t most_kicked = 8;  // rows of one sweep
constexpr std::size_t most_heard = 8;
constexpr std::size_t most_shoved = 4;

template <bool Crossed>
constexpr std::size_t parts = Crossed ? 2 : 1;  // numbers per mode of a shape

template <class T>
using ModePack = Pack<T, vector_bytes(Isa::RESSORT_ISA)>;
template <class T>
constexpr std::size_t mode_lanes = vector_bytes(Isa::RESSORT_ISA) / sizeof(T);

template <class T>
ModePack<T>* packs(T* numbers) {
  return reinterpret_cast<ModePack<T>*>(numbers);
}
template <class T>
const ModePack<T>* packs(const T* numbers) {
  return reinterpret_cast<const ModePack<T>*>(numbers);
}
template <class T>
std::size_t pack_count(const ModalState<T>& s) {
  return s.sleep.swept / mode_lanes<T>;
}
template <class T>
std::size_t all_packs(const ModalState<T>& s) {
  return s.shapes.modes / mode_lanes<T>;
}

// Returns the sum of the lanes, by halves: adding lane after lane would take as long as the rest of
// a short sweep.
template <class T, std::size_t Bytes = vector_bytes(Isa::RESSORT_ISA)>
T total(Pack<T, Bytes> sum) {
  if constexpr (Bytes > 16) {
    const auto* const halves = reinterpret_cast<const Pack<T, Bytes / 2>*>(&sum);
    return total<T, Bytes / 2>(halves[0] + halves[1]);
  } else if constexpr (sizeof(T) == 4) {
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
  } else {
    return sum[0] + sum[1];
  }
}

template <class T>
T along(const ModalState<T>& s, const T* row, const T* numbers) {
  ModePack<T> even{};
  ModePack<T> odd{};
  for (std::size_t i = 0; i + 1 < pack_count(s); i += 2) {
    even += packs(row)[i] * packs(numbers)[i];
    odd += packs(row)[i + 1] * packs(numbers)[i + 1];
  }
  return total<T>(even + odd);
}

// Returns the displacement along a row; for crossed modes, the real part of the product.
template <bool Crossed, class T>
T read(const ModalState<T>& s, const T* row) {
  const T even = along(s, row, s.motion.q);
  return Crossed ? even - along(s, row + s.shapes.stride, s.motion.d) : even;
}

// Returns the displacement along one row by a unit push along another.
template <bool Crossed, class T>
T reply(const ModalState<T>& s, const T* one, const T* other) {
  ModePack<T> sum{};
  for (std::size_t i = 0; i < all_packs(s); ++i) {
    sum += packs(one)[i] * packs(other)[i];
    if constexpr (Crossed) {
      sum -= packs(one + s.shapes.stride)[i] * packs(other + s.shapes.stride)[i];
    }
  }
  return total<T>(sum);
}

template <class T>
void keep(const ModalState<T>& s, T* to, const T* from) {
  for (std::size_t i = 0; i < pack_count(s); ++i) {
    packs(to)[i] = packs(from)[i];
  }
}

// Interleaves the rows of a sweep, [pack][row][part], so that the sweep reads memory in one stream.
// Null is a row of zeros.
template <bool Crossed, class T>
void bundle(ModalState<T>& s, std::size_t rows) {
  bool is_same = rows == s.sweep.bundled && s.sleep.swept <= s.sweep.bundled_modes;
  for (std::size_t r = 0; r < rows && is_same; ++r) {
    is_same = s.sweep.rows[r] == s.sweep.bundled_rows[r];
  }
  if (is_same) {
    return;
  }
  s.sweep.bundled = rows;
  s.sweep.bundled_modes = s.sleep.swept;
  for (std::size_t r = 0; r < rows; ++r) {
    s.sweep.bundled_rows[r] = s.sweep.rows[r];
    for (std::size_t part = 0; part < parts<Crossed>; ++part) {
      const T* const row =
          s.sweep.rows[r] == nullptr ? nullptr : s.sweep.rows[r] + part * s.shapes.stride;
      for (std::size_t i = 0; i < pack_count(s); ++i) {
        packs(s.sweep.bundle)[(i * rows + r) * parts<Crossed> + part] =
            row == nullptr ? ModePack<T>{} : packs(row)[i];
      }
    }
  }
}

// Advances all modes by `Samples` samples. Each mode is an oscillator stepped by symplectic Euler:
//   d[n+1] = d[n] - lZ d[n] - lK q[n] + kicks,   q[n+1] = q[n] + d[n+1]
// or, if Crossed, y[n+1] = y[n] + (pole - 1) y[n] + kicks for y = q + i d.
// The first `Kicked` rows of the bundle add s.sweep.kick [sample][row] and, if Felt, return their
// velocity in s.sweep.speed [row]. The next `Heard` rows return their displacement in s.sweep.heard
// [sample][row]. If Shoved, the kicks are the displacements by passive links at the end of the
// sample before, which are added to q and d alike.
template <std::size_t Samples, std::size_t Kicked, bool Felt, std::size_t Heard, bool Crossed,
          bool Shoved, class T>
void sweep(ModalState<T>& s) {
  using V = ModePack<T>;
  constexpr std::size_t width = parts<Crossed>;
  V* const q = packs(s.motion.q);
  V* const d = packs(s.motion.d);
  const V* const k = packs(s.motion.k);
  const V* const z = packs(s.motion.z);
  const V* row = packs(s.sweep.bundle);
  // One sum at a time would be slower than its additions are: each waits for the one before.
  constexpr std::size_t sums = Samples == 1 && Kicked + Heard <= 3 ? 2 : 1;
  V kick[Samples * Kicked + 1];
  V speed[sums][Kicked + 1];
  V heard[sums][Samples * Heard + 1];
#pragma GCC unroll 16
  for (std::size_t r = 0; r < Samples * Kicked; ++r) {
    kick[r] = V{} + s.sweep.kick[r];
  }
#pragma GCC unroll 2
  for (std::size_t sum = 0; sum < sums; ++sum) {
#pragma GCC unroll 16
    for (std::size_t r = 0; r < Kicked; ++r) {
      speed[sum][r] = V{};
    }
#pragma GCC unroll 16
    for (std::size_t r = 0; r < Samples * Heard; ++r) {
      heard[sum][r] = V{};
    }
  }
  const std::size_t count = pack_count(s);
  const auto advance = [&](std::size_t i, std::size_t sum_of) __attribute__((always_inline)) {
    V qi = q[i];
    V di = d[i];
    const V ki = k[i];
    const V zi = z[i];
    V kicked[Kicked + 1];
#pragma GCC unroll 16
    for (std::size_t r = 0; r < Kicked && !Crossed; ++r) {
      kicked[r] = row[r];
    }
#pragma GCC unroll 16
    for (std::size_t n = 0; n < Samples; ++n) {
      // Two sums of the kicks, to hide their latency: q and d depend on each other. Crossed modes
      // have a sum for each part.
      V f[2] = {};
#pragma GCC unroll 16
      for (std::size_t r = 0; r < Kicked; ++r) {
        if constexpr (Crossed) {
          f[0] += kick[n * Kicked + r] * row[width * r];
          f[1] += kick[n * Kicked + r] * row[width * r + 1];
        } else {
          f[r % 2] += kick[n * Kicked + r] * kicked[r];
        }
      }
      if constexpr (Crossed) {
        if constexpr (Shoved) {
          qi += std::exchange(f[0], V{});
          di += std::exchange(f[1], V{});
        }
        f[0] += ki * qi - zi * di;
        f[1] += ki * di + zi * qi;
        qi += f[0];
        di += f[1];
      } else {
        const V sum = Kicked > 1 ? f[0] + f[1] : f[0];
        if constexpr (Shoved) {
          qi += sum;
          di += sum;
        }
        di -= zi * di;
        di -= ki * qi;
        if constexpr (Kicked > 0 && !Shoved) {
          di += sum;
        }
        qi += di;
      }
#pragma GCC unroll 16
      for (std::size_t r = 0; r < Kicked && Felt; ++r) {
        if constexpr (Crossed) {
          speed[sum_of][r] += row[width * r] * f[0] - row[width * r + 1] * f[1];
        } else {
          speed[sum_of][r] += kicked[r] * di;
        }
      }
#pragma GCC unroll 16
      for (std::size_t r = 0; r < Heard; ++r) {
        heard[sum_of][n * Heard + r] += row[width * (Kicked + r)] * qi;
        if constexpr (Crossed) {
          heard[sum_of][n * Heard + r] -= row[width * (Kicked + r) + 1] * di;
        }
      }
    }
    q[i] = qi;
    d[i] = di;
    row += width * (Kicked + Heard);
  };
  for (std::size_t i = 0; i < count; i += sums) {
#pragma GCC unroll 2
    for (std::size_t sum = 0; sum < sums; ++sum) {
      advance(i + sum, sum);
    }
  }
#pragma GCC unroll 16
  for (std::size_t r = 0; r < Kicked && Felt; ++r) {
    s.sweep.speed[r] = total<T>(sums == 1 ? speed[0][r] : speed[0][r] + speed[sums - 1][r]);
  }
#pragma GCC unroll 16
  for (std::size_t r = 0; r < Samples * Heard; ++r) {
    s.sweep.heard[r] = total<T>(sums == 1 ? heard[0][r] : heard[0][r] + heard[sums - 1][r]);
  }
}

// Advances by one sample, with up to most_kicked rows that are kicked and two that are heard.
template <std::size_t Heard, bool Crossed, bool Shoved, class T>
void sweep_sample(ModalState<T>& s, std::size_t kicked) {
  switch (kicked) {
    case 0:
      return sweep<1, 0, true, Heard, Crossed, Shoved>(s);
    case 1:
      return sweep<1, 1, true, Heard, Crossed, Shoved>(s);
    case 2:
      return sweep<1, 2, true, Heard, Crossed, Shoved>(s);
    case 3:
      return sweep<1, 3, true, Heard, Crossed, Shoved>(s);
    case 4:
      return sweep<1, 4, true, Heard, Crossed, Shoved>(s);
    case 5:
      return sweep<1, 5, true, Heard, Crossed, Shoved>(s);
    case 6:
      return sweep<1, 6, true, Heard, Crossed, Shoved>(s);
    case 7:
      return sweep<1, 7, true, Heard, Crossed, Shoved>(s);
    default:
      return sweep<1, most_kicked, true, Heard, Crossed, Shoved>(s);
  }
}
template <bool Crossed, bool Shoved, class T>
void sweep_sample(ModalState<T>& s, std::size_t kicked, std::size_t heard) {
  switch (heard) {
    case 0:
      return sweep_sample<0, Crossed, Shoved>(s, kicked);
    case 1:
      return sweep_sample<1, Crossed, Shoved>(s, kicked);
    default:
      return sweep_sample<2, Crossed, Shoved>(s, kicked);
  }
}

// The following do the same for any number of rows, one by one.
template <class T>
void kick_row(const ModalState<T>& s, T* load, const T* row, T kick) {
  for (std::size_t i = 0; kick != 0 && i < pack_count(s); ++i) {
    packs(load)[i] += kick * packs(row)[i];
  }
}
// Adds s.passive.shove along `Rows` rows of places to q and d. Rows beyond the last add 0.
template <bool Crossed, std::size_t Rows, class T>
void shove_some(ModalState<T>& s, std::size_t first) {
  using V = ModePack<T>;
  const T* row[Rows];
  V shove[Rows];
#pragma GCC unroll 16
  for (std::size_t r = 0; r < Rows; ++r) {
    const bool is_there = first + r < s.held.places;
    row[r] = s.sweep.rows[is_there ? first + r : first];
    shove[r] = V{} + (is_there ? s.passive.shove[first + r] : T(0));
  }
  for (std::size_t i = 0; i < pack_count(s); ++i) {
    V q{};
    V d{};
#pragma GCC unroll 16
    for (std::size_t r = 0; r < Rows; ++r) {
      q += shove[r] * packs(row[r])[i];
      if constexpr (Crossed) {
        d += shove[r] * packs(row[r] + s.shapes.stride)[i];
      }
    }
    packs(s.motion.q)[i] += q;
    packs(s.motion.d)[i] += Crossed ? d : q;
  }
}
template <bool Crossed, class T>
void shove_rows(ModalState<T>& s) {
  for (std::size_t row = 0; row < s.held.places; row += most_shoved) {
    if (row + 1 == s.held.places) {
      shove_some<Crossed, 1>(s, row);
    } else {
      shove_some<Crossed, most_shoved>(s, row);
    }
  }
}
template <bool Crossed, class T>
void sweep_rows(ModalState<T>& s, std::size_t kicked, std::size_t heard) {
  T* const load[2] = {s.sweep.load, s.sweep.load + s.shapes.stride};
  for (std::size_t i = 0; i < pack_count(s); ++i) {
    const auto k = packs(s.motion.k)[i];
    const auto z = packs(s.motion.z)[i];
    const auto q = packs(s.motion.q)[i];
    const auto d = packs(s.motion.d)[i];
    packs(load[0])[i] = Crossed ? k * q - z * d : -(k * q + z * d);
    if constexpr (Crossed) {
      packs(load[1])[i] = k * d + z * q;
    }
  }
  for (std::size_t r = 0; r < kicked; ++r) {
    for (std::size_t part = 0; part < parts<Crossed>; ++part) {
      kick_row(s, load[part], s.sweep.rows[r] + part * s.shapes.stride, s.sweep.kick[r]);
    }
  }
  for (std::size_t i = 0; i < pack_count(s); ++i) {
    if constexpr (Crossed) {
      packs(s.motion.q)[i] += packs(load[0])[i];
      packs(s.motion.d)[i] += packs(load[1])[i];
    } else {
      packs(s.motion.d)[i] += packs(load[0])[i];
      packs(s.motion.q)[i] += packs(s.motion.d)[i];
    }
  }
  for (std::size_t r = 0; r < kicked; ++r) {
    s.sweep.speed[r] = Crossed ? along(s, s.sweep.rows[r], load[0]) -
                                     along(s, s.sweep.rows[r] + s.shapes.stride, load[1])
                               : along(s, s.sweep.rows[r], s.motion.d);
  }
  for (std::size_t r = 0; r < heard; ++r) {
    s.sweep.heard[r] = read<Crossed>(s, s.sweep.rows[kicked + r]);
  }
}

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA
