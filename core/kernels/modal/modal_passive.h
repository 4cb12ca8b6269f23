// core/kernels: passive links (passive.h) on the modes of a ModalState. A part of modal_step.cpp.
//
// A unit push between the ends of one link changes the distance of another link's ends by the sum
// over all modes of the products of their shapes. This is the matrix `gamma` (the compliance in one
// sample, a Schur complement): the links are solved with it before the modes move. The compliance
// of the modes that are left out counts as one more mode of each link, which follows its force one
// sample later: lK = lZ = 1, so 4 - lK - 2 lZ > 0 and no link gains energy with it either.
#pragma once

#include "core/kernels/modal/modal_sleep.h"
#include "core/kernels/modal/modal_straight.h"
#include "core/kernels/passive/passive.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

// Computes the displacement of each listener and link by a unit push of each link, for w = 1.
template <bool Crossed, class T>
void measure_replies(ModalState<T>& s, std::size_t places, std::size_t outputs) {
  for (std::size_t l = 0; l < places + outputs; ++l) {
    const T* const row = listener(s, places, l);
    for (std::size_t i = 0; i < s.passive.count; ++i) {
      T sum = 0;
      for (const bool is_b : {false, true}) {
        const std::uint32_t end = is_b ? s.passive.links[i].ends.b : s.passive.links[i].ends.a;
        if (end < places) {
          const T moved = reply<Crossed>(s, row, s.shapes.places + end * s.shapes.row);
          sum += is_b ? -moved : moved;
        }
      }
      s.passive.reply[l * s.passive.count + i] = sum;
    }
  }
  for (std::size_t i = 0; i < s.passive.count; ++i) {
    for (std::size_t k = 0; k < s.passive.count; ++k) {
      const auto [a, b] = s.passive.links[i].ends;
      s.passive.gamma[i * s.passive.count + k] =
          (a < places ? s.passive.reply[a * s.passive.count + k] : T(0)) -
          (b < places ? s.passive.reply[b * s.passive.count + k] : T(0));
    }
  }
}

// The interface that passive.h needs. Here the first end of a link is its own number; it has no
// second.
template <class T>
struct ModalBody {
  CoefficientView<T> coefficients() const { return {s.ramps.value}; }
  T awake() const { return s.passive.pulls ? T(1) : T(0); }
  T distance_now(Ends link) const {
    const auto [a, b] = s.passive.links[link.a].ends;
    return s.ends.x[a] - s.ends.x[b] + s.passive.yield[link.a];
  }
  T speed_now(Ends link) const {
    const auto [a, b] = s.passive.links[link.a].ends;
    return s.ends.v[a] - s.ends.v[b] + s.passive.yield_step[link.a];
  }
  T distance(Ends link) const { return s.passive.opening[link.a]; }
  T speed(Ends link) const { return s.passive.rush[link.a]; }
  T gamma(Ends link) const { return give(link.a, link.a); }
  T coupling(Ends one, Ends other) const { return give(one.a, other.a); }
  void push(Ends link, T force) {
    s.passive.pushed[link.a] = force;
    for (const PassiveLink& other : s.passive.active->links) {
      const T moved = give(other.ends.a, link.a) * force;
      s.passive.opening[other.ends.a] -= moved;
      s.passive.rush[other.ends.a] -= moved;
    }
  }

  T give(std::uint32_t at, std::uint32_t from) const {
    return w * s.passive.gamma[at * s.passive.count + from] +
           (at == from ? s.passive.slack[at] : T(0));
  }

  ModalState<T>& s;
  T w;
};

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA
