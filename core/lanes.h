// core: the SIMD type and aligned memory. Kernels are written once over Pack<T, Bytes> and compiled
// for each instruction set (see isa.h). The functions here are `static`, so each of these units has
// its own copy: code for a wide machine is never linked into code that runs on a narrow one.
#pragma once

#include <cmath>
#include <cstddef>
#include <new>
#include <type_traits>
#include <vector>

namespace ressort {

template <class T, std::size_t Bytes>
struct PackOf;
template <std::size_t Bytes>
struct PackOf<float, Bytes> {
  typedef float Type __attribute__((vector_size(Bytes), may_alias));
};
template <std::size_t Bytes>
struct PackOf<double, Bytes> {
  typedef double Type __attribute__((vector_size(Bytes), may_alias));
};

// A vector of Bytes / sizeof(T) numbers.
template <class T, std::size_t Bytes>
using Pack = typename PackOf<T, Bytes>::Type;

// The element type of a pack. A plain number is its own element.
template <class V>
struct ScalarOf {
  using Type = decltype(V{}[0] + V{}[0]);
};
template <>
struct ScalarOf<float> {
  using Type = float;
};
template <>
struct ScalarOf<double> {
  using Type = double;
};
template <class V>
using Scalar = typename ScalarOf<V>::Type;

// Unaligned load and store.
template <class V>
static inline V load(const Scalar<V>* from) {
  V pack;
  __builtin_memcpy(&pack, from, sizeof pack);
  return pack;
}

template <class V>
static inline void store(Scalar<V>* to, V pack) {
  __builtin_memcpy(to, &pack, sizeof pack);
}

// Returns a in the lanes where the mask is set, b elsewhere.
template <class V, class Mask>
static inline V select(Mask mask, V a, V b) {
  return mask ? a : b;
}

template <class V>
static inline V absolute(V x) {
  return select(x < V{}, -x, x);
}

// Returns max(x, 0).
template <class V>
static inline V positive(V x) {
  return select(x > V{}, x, V{});
}

// Returns -1, 0 or 1.
template <class V>
static inline V sign(V x) {
  const V one = V{} + 1;
  return select(x > V{}, one, select(x < V{}, -one, V{}));
}

template <class V>
static inline V exponential(V x) {
  if constexpr (sizeof(V) == sizeof(Scalar<V>)) {
    return std::exp(x);
  } else {
    for (std::size_t i = 0; i < sizeof(V) / sizeof(Scalar<V>); ++i) {
      x[i] = std::exp(x[i]);
    }
    return x;
  }
}

template <class V>
static inline V square_root(V x) {
  if constexpr (sizeof(V) == sizeof(Scalar<V>)) {
    return std::sqrt(x);
  } else {
    for (std::size_t i = 0; i < sizeof(V) / sizeof(Scalar<V>); ++i) {
      x[i] = std::sqrt(x[i]);
    }
    return x;
  }
}

// Reduces a pack to one number by a binary tree over halves, which avoids a serial dependency.
template <class V, class Both>
[[gnu::always_inline]] static inline auto folded(V pack, Both both) {
  using Number = Scalar<V>;
  if constexpr (sizeof(V) > 16) {
    typedef Number Half __attribute__((vector_size(sizeof(V) / 2), may_alias));
    Half halves[2];
    __builtin_memcpy(halves, &pack, sizeof pack);
    return folded(both(halves[0], halves[1]), both);
  } else {
    Number all = pack[0];
    for (std::size_t i = 1; i < sizeof(V) / sizeof(Number); ++i) {
      all = both(all, pack[i]);
    }
    return all;
  }
}

// Returns whether a mask (the result of a comparison) is set in any lane.
template <class Mask>
static inline bool any_of(Mask mask) {
  if constexpr (std::is_integral_v<Mask>) {
    return mask != 0;
  } else {
    typedef long long Bits __attribute__((vector_size(sizeof(Mask)), may_alias));
    Bits bits;
    __builtin_memcpy(&bits, &mask, sizeof mask);
    return folded(bits, [](auto a, auto b) { return a | b; }) != 0;
  }
}

// Returns x^y for x >= 0; 0^0 is 1. A small multiple of 1/2, such as Hertz's 1.5, takes a tenth of
// the time of std::pow().
template <class V>
static inline V power(V x, V y) {
  constexpr Scalar<V> most = 6;
  const V twice = y + y;
  Scalar<V> first;
  __builtin_memcpy(&first, &twice, sizeof first);
  if (first >= 0 && first <= most) {
    const int halves = static_cast<int>(first);
    if (!any_of(twice != V{} + static_cast<Scalar<V>>(halves))) {
      V product = halves % 2 == 1 ? square_root(x) : V{} + 1;
      for (int i = 0; i < halves / 2; ++i) {
        product *= x;
      }
      return product;
    }
  }
  if constexpr (sizeof(V) == sizeof(Scalar<V>)) {
    return std::pow(x, y);
  } else {
    for (std::size_t i = 0; i < sizeof(V) / sizeof(Scalar<V>); ++i) {
      x[i] = std::pow(x[i], y[i]);
    }
    return x;
  }
}

// Returns whether one of the numbers is 0, or, if `zero` is false, whether one is not.
template <std::size_t Bytes>
static inline bool is_any(const double* numbers, std::size_t count, bool zero) {
  using V = Pack<double, Bytes>;
  constexpr std::size_t lanes = Bytes / sizeof(double);
  auto found = V{} != V{};
  std::size_t n = 0;
  for (; n + lanes <= count; n += lanes) {
    const auto is_zero = load<V>(numbers + n) == V{};
    found |= zero ? is_zero : ~is_zero;
  }
  bool is_found = any_of(found);
  for (; n < count; ++n) {
    is_found |= (numbers[n] == 0.0) == zero;
  }
  return is_found;
}

inline constexpr std::size_t widest_bytes = 64;  // size of the widest pack

// Allocates on cache lines, so that every pack is aligned.
template <class T>
struct LineAllocator {
  using value_type = T;
  LineAllocator() = default;
  template <class U>
  LineAllocator(const LineAllocator<U>&) {}
  T* allocate(std::size_t count) {
    return static_cast<T*>(::operator new (count * sizeof(T), std::align_val_t{widest_bytes}));
  }
  void deallocate(T* memory, std::size_t) {
    ::operator delete (memory, std::align_val_t{widest_bytes});
  }
  bool operator==(const LineAllocator&) const = default;
};

template <class T>
using Aligned = std::vector<T, LineAllocator<T>>;

}  // namespace ressort
