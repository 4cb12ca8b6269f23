// core/engine: packs to and from numbers that need not be aligned; for the dense kernel's loops.
#pragma once

#include "core/engine/lanes.h"

namespace ressort {

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

}  // namespace ressort
