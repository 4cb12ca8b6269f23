// core/kernels: the sweeps over the modes of a ModalState; the inner part of modal_step.cpp, which
// alone includes it.
#pragma once

#include "core/kernels/modal/modal.h"

namespace ressort::RESSORT_ISA {
namespace {

constexpr std::size_t most_kicked = 8;  // rows that one sweep takes along
constexpr std::size_t most_heard = 8;

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
  return s.swept / mode_lanes<T>;
}
template <class T>
std::size_t all_packs(const ModalState<T>& s) {
  return s.modes / mode_lanes<T>;
}

// By halves: one lane after the other would take as long as the rest of a short sweep.
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

template <class T>
void keep(const ModalState<T>& s, T* to, const T* from) {
  for (std::size_t i = 0; i < pack_count(s); ++i) {
    packs(to)[i] = packs(from)[i];
  }
}

// Lays the rows that a sweep needs side by side, pack by pack; null is a row of zeros.
template <class T>
void bundle(ModalState<T>& s, std::size_t rows) {
  bool is_same = rows == s.bundled && s.swept <= s.bundled_modes;
  for (std::size_t r = 0; r < rows && is_same; ++r) {
    is_same = s.rows[r] == s.bundled_rows[r];
  }
  if (is_same) {
    return;
  }
  s.bundled = rows;
  s.bundled_modes = s.swept;
  for (std::size_t r = 0; r < rows; ++r) {
    s.bundled_rows[r] = s.rows[r];
    for (std::size_t i = 0; i < pack_count(s); ++i) {
      packs(s.bundle)[i * rows + r] = s.rows[r] == nullptr ? ModePack<T>{} : packs(s.rows[r])[i];
    }
  }
}

// All modes through a few samples. Of the bundled rows the first are kicked by s.kick [sample][row]
// and, if Felt, give their speed to s.speed [row], of one sample; the others give their position
// to s.heard [sample][row].
template <std::size_t Samples, std::size_t Kicked, bool Felt, std::size_t Heard, class T>
void sweep(ModalState<T>& s) {
  using V = ModePack<T>;
  V* const q = packs(s.q);
  V* const d = packs(s.d);
  const V* const k = packs(s.k);
  const V* const z = packs(s.z);
  const V* row = packs(s.bundle);
  V kick[Samples * Kicked + 1];
  V speed[Kicked + 1];
  V heard[Samples * Heard + 1];
#pragma GCC unroll 16
  for (std::size_t r = 0; r < Samples * Kicked; ++r) {
    kick[r] = V{} + s.kick[r];
  }
#pragma GCC unroll 16
  for (std::size_t r = 0; r < Kicked; ++r) {
    speed[r] = V{};
  }
#pragma GCC unroll 16
  for (std::size_t r = 0; r < Samples * Heard; ++r) {
    heard[r] = V{};
  }
  const std::size_t count = pack_count(s);
  for (std::size_t i = 0; i < count; ++i) {
    V qi = q[i];
    V di = d[i];
    const V ki = k[i];
    const V zi = z[i];
#pragma GCC unroll 16
    for (std::size_t n = 0; n < Samples; ++n) {
      // The kicks in two sums, which wait for nothing; q and d wait for each other.
      V f[2] = {};
#pragma GCC unroll 16
      for (std::size_t r = 0; r < Kicked; ++r) {
        f[r % 2] += kick[n * Kicked + r] * row[r];
      }
      di -= zi * di;
      di -= ki * qi;
      if constexpr (Kicked > 0) {
        di += Kicked > 1 ? f[0] + f[1] : f[0];
      }
      qi += di;
#pragma GCC unroll 16
      for (std::size_t r = 0; r < Kicked && Felt; ++r) {
        speed[r] += row[r] * di;
      }
#pragma GCC unroll 16
      for (std::size_t r = 0; r < Heard; ++r) {
        heard[n * Heard + r] += row[Kicked + r] * qi;
      }
    }
    q[i] = qi;
    d[i] = di;
    row += Kicked + Heard;
  }
#pragma GCC unroll 16
  for (std::size_t r = 0; r < Kicked && Felt; ++r) {
    s.speed[r] = total<T>(speed[r]);
  }
#pragma GCC unroll 16
  for (std::size_t r = 0; r < Samples * Heard; ++r) {
    s.heard[r] = total<T>(heard[r]);
  }
}

// One sample, for up to most_kicked rows that are kicked and felt, and two that are heard.
template <std::size_t Heard, class T>
void sweep_sample(ModalState<T>& s, std::size_t kicked) {
  switch (kicked) {
    case 0:
      return sweep<1, 0, true, Heard>(s);
    case 1:
      return sweep<1, 1, true, Heard>(s);
    case 2:
      return sweep<1, 2, true, Heard>(s);
    case 3:
      return sweep<1, 3, true, Heard>(s);
    case 4:
      return sweep<1, 4, true, Heard>(s);
    case 5:
      return sweep<1, 5, true, Heard>(s);
    case 6:
      return sweep<1, 6, true, Heard>(s);
    case 7:
      return sweep<1, 7, true, Heard>(s);
    default:
      return sweep<1, most_kicked, true, Heard>(s);
  }
}
template <class T>
void sweep_sample(ModalState<T>& s, std::size_t kicked, std::size_t heard) {
  switch (heard) {
    case 0:
      return sweep_sample<0>(s, kicked);
    case 1:
      return sweep_sample<1>(s, kicked);
    default:
      return sweep_sample<2>(s, kicked);
  }
}

// The same for any number of rows, one by one.
template <class T>
void kick_row(ModalState<T>& s, const T* row, T kick) {
  for (std::size_t i = 0; kick != 0 && i < pack_count(s); ++i) {
    packs(s.load)[i] += kick * packs(row)[i];
  }
}
template <class T>
void sweep_rows(ModalState<T>& s, std::size_t kicked, std::size_t heard) {
  for (std::size_t i = 0; i < pack_count(s); ++i) {
    packs(s.load)[i] = -(packs(s.k)[i] * packs(s.q)[i] + packs(s.z)[i] * packs(s.d)[i]);
  }
  for (std::size_t r = 0; r < kicked; ++r) {
    kick_row(s, s.rows[r], s.kick[r]);
  }
  for (std::size_t i = 0; i < pack_count(s); ++i) {
    packs(s.d)[i] += packs(s.load)[i];
    packs(s.q)[i] += packs(s.d)[i];
  }
  for (std::size_t r = 0; r < kicked; ++r) {
    s.speed[r] = along(s, s.rows[r], s.d);
  }
  for (std::size_t r = 0; r < heard; ++r) {
    s.heard[r] = along(s, s.rows[kicked + r], s.q);
  }
}

}  // namespace
}  // namespace ressort::RESSORT_ISA
