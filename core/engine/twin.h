// core/engine: two packs that are worked on as one, for loops that would wait for one pack's
// results or take longer to find its numbers than to work on them. Laws take it like a pack.
#pragma once

#include <type_traits>

#include "core/engine/lanes.h"

namespace ressort {

template <class V>
struct Twin {
  V low;
  V high;
};

template <class V>
struct ScalarOf<Twin<V>> {
  using Type = Scalar<V>;
};

// Numbers beside packs: each lane has the same.
template <class V, class Use>
[[gnu::always_inline]] static inline auto both(const Twin<V>& a, const Twin<V>& b, Use&& use) {
  return Twin<decltype(use(a.low, b.low))>{use(a.low, b.low), use(a.high, b.high)};
}
template <class V, class Use, class N>
requires std::is_arithmetic_v<N>
[[gnu::always_inline]] static inline auto both(const Twin<V>& a, N n, Use&& use) {
  const auto b = static_cast<Scalar<V>>(n);
  return Twin<decltype(use(a.low, b))>{use(a.low, b), use(a.high, b)};
}
template <class V, class Use, class N>
requires std::is_arithmetic_v<N>
[[gnu::always_inline]] static inline auto both(N n, const Twin<V>& b, Use&& use) {
  const auto a = static_cast<Scalar<V>>(n);
  return Twin<decltype(use(a, b.low))>{use(a, b.low), use(a, b.high)};
}

template <class T>
struct IsTwin : std::false_type {};
template <class V>
struct IsTwin<Twin<V>> : std::true_type {};
template <class A, class B>
concept OneIsTwin = IsTwin<A>::value || IsTwin<B>::value;

template <class A, class B>
requires OneIsTwin<A, B>
[[gnu::always_inline]] static inline auto operator+(const A& a, const B& b) {
  return both(a, b, [](auto l, auto r) { return l + r; });
}
template <class A, class B>
requires OneIsTwin<A, B>
[[gnu::always_inline]] static inline auto operator-(const A& a, const B& b) {
  return both(a, b, [](auto l, auto r) { return l - r; });
}
template <class A, class B>
requires OneIsTwin<A, B>
[[gnu::always_inline]] static inline auto operator*(const A& a, const B& b) {
  return both(a, b, [](auto l, auto r) { return l * r; });
}
template <class A, class B>
requires OneIsTwin<A, B>
[[gnu::always_inline]] static inline auto operator/(const A& a, const B& b) {
  return both(a, b, [](auto l, auto r) { return l / r; });
}
template <class V>
[[gnu::always_inline]] static inline Twin<V> operator-(const Twin<V>& a) {
  return {-a.low, -a.high};
}
template <class V>
[[gnu::always_inline]] static inline Twin<V>& operator+=(Twin<V>& a, const Twin<V>& b) {
  return a = a + b;
}
template <class V>
[[gnu::always_inline]] static inline Twin<V>& operator-=(Twin<V>& a, const Twin<V>& b) {
  return a = a - b;
}
template <class V>
[[gnu::always_inline]] static inline auto operator<(const Twin<V>& a, const Twin<V>& b) {
  return both(a, b, [](auto l, auto r) { return l < r; });
}
template <class V>
[[gnu::always_inline]] static inline auto operator<=(const Twin<V>& a, const Twin<V>& b) {
  return both(a, b, [](auto l, auto r) { return l <= r; });
}
template <class V>
[[gnu::always_inline]] static inline auto operator>(const Twin<V>& a, const Twin<V>& b) {
  return both(a, b, [](auto l, auto r) { return l > r; });
}
template <class V>
[[gnu::always_inline]] static inline auto operator>=(const Twin<V>& a, const Twin<V>& b) {
  return both(a, b, [](auto l, auto r) { return l >= r; });
}
template <class V>
[[gnu::always_inline]] static inline auto operator==(const Twin<V>& a, const Twin<V>& b) {
  return both(a, b, [](auto l, auto r) { return l == r; });
}

// Copies a pack into memory. A twin's plain copy may be cut into narrower pieces, for which the
// next load would have to wait.
template <class V>
[[gnu::always_inline]] static inline void put(const V& from, V& to) {
  if constexpr (IsTwin<V>::value) {
    to.low = from.low;
    to.high = from.high;
  } else {
    to = from;
  }
}

template <class V, class Mask>
[[gnu::always_inline]] static inline Twin<V> select(const Twin<Mask>& mask, const Twin<V>& a,
                                                    const Twin<V>& b) {
  return {select(mask.low, a.low, b.low), select(mask.high, a.high, b.high)};
}
template <class V>
static inline Twin<V> exponential(const Twin<V>& x) {
  return {exponential(x.low), exponential(x.high)};
}

}  // namespace ressort
