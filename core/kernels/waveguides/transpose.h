// core/kernels: transposes squares of samples and lanes. Included by *_step.cpp, which are compiled
// for each instruction set.
#pragma once

#include <cstddef>
#include <utility>

#include "core/lanes.h"
#include "core/rooms.h"

namespace ressort::kernels {

// Exchanges the right halves of `upper` with the left halves of `lower`, in all squares of size 2
// `half`.
template <std::size_t half, class V, std::size_t... i>
[[gnu::always_inline]] static inline void exchange(V& upper, V& lower, std::index_sequence<i...>) {
  constexpr std::size_t lanes = sizeof...(i);
  const V above = __builtin_shufflevector(upper, lower, ((i & half) ? lanes + i - half : i)...);
  lower = __builtin_shufflevector(upper, lower, ((i & half) ? lanes + i : i + half)...);
  upper = above;
}

// Transposes a square of as many packs as a pack has lanes.
template <std::size_t half, class V>
[[gnu::always_inline]] static inline void transpose_by(V* rows) {
  constexpr std::size_t lanes = sizeof(V) / sizeof(Scalar<V>);
  for (std::size_t i = 0; i < lanes; ++i) {
    if ((i & half) == 0) {
      exchange<half>(rows[i], rows[i + half], std::make_index_sequence<lanes>());
    }
  }
  if constexpr (half > 1) {
    transpose_by<half / 2>(rows);
  }
}
template <class V>
[[gnu::always_inline]] static inline void transpose(V* rows) {
  transpose_by<sizeof(V) / sizeof(Scalar<V>) / 2>(rows);
}

}  // namespace ressort::kernels
