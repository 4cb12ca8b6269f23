// core/kernels: passive links (passive.h) on the modes of a ModalState; a part of modal_step.cpp,
// which alone includes it.
//
// A push between the ends of one link moves those of another by the sum over all modes of the
// products of their shapes: `gamma`, by which the links are solved among themselves before the
// modes are touched. What modes that are left out give way counts as one mode more of each link,
// which is where its force has pushed it a sample later and forgets it in the next: lK = lZ = 1,
// 4 - lK - 2 lZ > 0. So with that, too, no link gains energy.
#pragma once

#include "core/kernels/modal/modal_hold.h"
#include "core/kernels/modal/modal_straight.h"
#include "core/kernels/passive/passive.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

// How a push moves what: for masses of 1/w of the relative mass of each.
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

// What passive.h asks: a link is its own first end, and has no other.
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

template <class T, bool Crossed>
struct Presser : Holder<T, Crossed> {
  using Base = Holder<T, Crossed>;
  using Base::modes;
  using Base::outputs;
  using Base::places;
  using Base::s;

  bool presses() const { return !s.passive.active->links.empty(); }

  // Whether what passive links push may wait for the next sample's sweep: where that kicks nothing
  // else, and nobody looks at the modes before.
  bool may_shove_later() const {
    const bool is_all = std::all_of(s.held.count_of, s.held.count_of + modes.holds.size(),
                                    [](std::uint32_t plain) { return plain == 0; });
    return presses() && is_all && s.inputs.pushing == 0 && s.forces.count == 0 &&
           s.held.places <= most_kicked;
  }
  // What has waited.
  void shove_now() {
    if (std::exchange(s.passive.shoves_later, false)) {
      shove_rows<Crossed>(s);
    }
  }

  // As a run of samples begins, or in each whose coefficients move.
  void measure_passive() {
    if (s.passive.is_reply_stale) {
      measure_replies<Crossed>(s, places, outputs);
      s.passive.is_reply_stale = false;
    }
    s.passive.is_straight_stale = true;
    for (std::size_t i = 0; i < s.passive.count; ++i) {
      s.passive.slack[i] =
          s.passive.give[i] > 0 ? s.passive.give[i] / this->coefficient(modes.give_by) : T(0);
    }
  }

  void remember_passive() {
    remember(*s.passive.active, s.passive.memory, ModalBody<T>{s, this->inverse_mass()});
  }

  // Once everything else has moved: finds what the links push with, and moves places, what is heard
  // and the modes. Gives whether any pushes.
  bool press() {
    const T w = this->inverse_mass();
    T* row = s.passive.memory;
    for (const PassiveLink& link : s.passive.active->links) {
      const std::uint32_t i = link.ends.a;
      const auto [a, b] = s.passive.links[i].ends;
      s.passive.opening[i] = s.ends.x[a] - s.ends.x[b];
      s.passive.rush[i] = s.ends.v[a] - s.ends.v[b] - s.passive.yield[i];
      row[2] = s.passive.pushed[i];  // where looking for it begins
      row += passive_rows;
    }
    ModalBody<T> body{s, w};
    if (!push_straight(s, body)) {
      correct(*s.passive.active, s.passive.memory, s.passive.numbers, body);
    }
    s.passive.pulls = true;
    std::fill_n(s.passive.shove, s.held.places, T(0));
    bool pushes = false;
    for (const PassiveLink& link : s.passive.active->links) {
      const std::uint32_t i = link.ends.a;
      const T force = s.passive.pushed[i];
      s.passive.yield_step[i] = -s.passive.yield[i] - s.passive.slack[i] * force;
      s.passive.yield[i] = -s.passive.slack[i] * force;
      pushes |= force != 0;
      shove(s.passive.links[i].ends.a, -force);
      shove(s.passive.links[i].ends.b, force);
    }
    for (std::size_t r = 0; pushes && r < s.held.places; ++r) {
      const T way = moved(s.held.place_of[r]);
      s.ends.x[s.held.place_of[r]] -= way;
      s.ends.v[s.held.place_of[r]] -= way;
    }
    for (std::size_t o = 0; pushes && o < outputs; ++o) {
      s.sweep.heard[o] -= moved(places + o);
    }
    if (pushes) {
      move_by_shoves();
    }
    return pushes;
  }

 private:
  // How far all pushes move a listener.
  T moved(std::size_t listener) const {
    T sum = 0;
    for (const PassiveLink& link : s.passive.active->links) {
      sum +=
          s.passive.reply[listener * s.passive.count + link.ends.a] * s.passive.pushed[link.ends.a];
    }
    return this->inverse_mass() * sum;
  }
  void shove(std::uint32_t end, T force) {
    s.ends.exerted[end] += force;
    if (end < places) {
      const T kick = this->inverse_mass() * force;
      s.passive.shove[s.held.row_of[end]] += kick;
      s.ends.kicked[end] += absolute(kick);
    }
  }
  void move_by_shoves() {
    if (s.sleep.awake < modes.modes) {
      this->wake();
      if (s.held.places + s.inputs.pushing <= most_kicked) {
        bundle<Crossed>(s, s.sweep.bundled);
      }
    }
    if (!s.passive.shoves_later) {
      shove_rows<Crossed>(s);
    }
  }
};

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA
