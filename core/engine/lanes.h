// core/engine: the one SIMD type. Kernels are written once over Lanes<T>; nothing else knows how
// wide a register is.
#pragma once

#include <cmath>
#include <cstddef>

namespace ressort {

inline constexpr std::size_t lane_bytes = 16;  // what every x86-64 and every NEON has

template <class T>
struct LaneTraits;
template <>
struct LaneTraits<float> {
  typedef float Type __attribute__((vector_size(lane_bytes)));
};
template <>
struct LaneTraits<double> {
  typedef double Type __attribute__((vector_size(lane_bytes)));
};

// `lane_count<T>` numbers that are worked on together, one voice in each.
template <class T>
using Lanes = typename LaneTraits<T>::Type;
template <class T>
inline constexpr std::size_t lane_count = lane_bytes / sizeof(T);

// a where the mask holds, b elsewhere, lane by lane.
template <class V, class Mask>
inline V select(Mask mask, V a, V b) {
  return mask ? a : b;
}

template <class V>
inline V absolute(V x) {
  return select(x < V{}, -x, x);
}

// -1, 0 or 1.
template <class V>
inline V sign(V x) {
  const V one = V{} + 1;
  return select(x > V{}, one, select(x < V{}, -one, V{}));
}

template <class V>
inline V exponential(V x) {
  for (std::size_t i = 0; i < sizeof(V) / sizeof(x[0]); ++i) {
    x[i] = std::exp(x[i]);
  }
  return x;
}

}  // namespace ressort
