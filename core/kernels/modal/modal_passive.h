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
    for (std::size_t i = 0; i < s.passives; ++i) {
      T sum = 0;
      for (const bool is_b : {false, true}) {
        const std::uint32_t end = is_b ? s.passive[i].ends.b : s.passive[i].ends.a;
        if (end < places) {
          const T moved = reply<Crossed>(s, row, s.places + end * s.row);
          sum += is_b ? -moved : moved;
        }
      }
      s.reply[l * s.passives + i] = sum;
    }
  }
  for (std::size_t i = 0; i < s.passives; ++i) {
    for (std::size_t k = 0; k < s.passives; ++k) {
      const auto [a, b] = s.passive[i].ends;
      s.gamma[i * s.passives + k] = (a < places ? s.reply[a * s.passives + k] : T(0)) -
                                    (b < places ? s.reply[b * s.passives + k] : T(0));
    }
  }
}

// What passive.h asks: a link is its own first end, and has no other.
template <class T>
struct ModalBody {
  CoefficientView<T> coefficients() const { return {s.ramps.value}; }
  T awake() const { return s.pulls ? T(1) : T(0); }
  T distance_now(Ends link) const {
    const auto [a, b] = s.passive[link.a].ends;
    return s.x[a] - s.x[b] + s.yield[link.a];
  }
  T speed_now(Ends link) const {
    const auto [a, b] = s.passive[link.a].ends;
    return s.v[a] - s.v[b] + s.yield_step[link.a];
  }
  T distance(Ends link) const { return s.opening[link.a]; }
  T speed(Ends link) const { return s.rush[link.a]; }
  T gamma(Ends link) const { return give(link.a, link.a); }
  T coupling(Ends one, Ends other) const { return give(one.a, other.a); }
  void push(Ends link, T force) {
    s.pushed[link.a] = force;
    for (const PassiveLink& other : s.active->links) {
      const T moved = give(other.ends.a, link.a) * force;
      s.opening[other.ends.a] -= moved;
      s.rush[other.ends.a] -= moved;
    }
  }

  T give(std::uint32_t at, std::uint32_t from) const {
    return w * s.gamma[at * s.passives + from] + (at == from ? s.slack[at] : T(0));
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

  bool presses() const { return !s.active->links.empty(); }

  // Whether what passive links push may wait for the next sample's sweep: where that kicks nothing
  // else, and nobody looks at the modes before.
  bool may_shove_later() const {
    const bool is_all = std::all_of(s.held, s.held + modes.holds.size(),
                                    [](std::uint32_t plain) { return plain == 0; });
    return presses() && is_all && s.pushing == 0 && s.forces == 0 && s.held_places <= most_kicked;
  }
  // What has waited.
  void shove_now() {
    if (std::exchange(s.shoves_later, false)) {
      shove_rows<Crossed>(s);
    }
  }

  // As a run of samples begins, or in each whose coefficients move.
  void measure_passive() {
    if (s.is_reply_stale) {
      measure_replies<Crossed>(s, places, outputs);
      s.is_reply_stale = false;
    }
    s.is_straight_stale = true;
    for (std::size_t i = 0; i < s.passives; ++i) {
      s.slack[i] = s.give[i] > 0 ? s.give[i] / this->coefficient(modes.give_by) : T(0);
    }
  }

  void remember_passive() { remember(*s.active, s.memory, ModalBody<T>{s, this->inverse_mass()}); }

  // Once everything else has moved: finds what the links push with, and moves places, what is heard
  // and the modes. Gives whether any pushes.
  bool press() {
    const T w = this->inverse_mass();
    T* row = s.memory;
    for (const PassiveLink& link : s.active->links) {
      const std::uint32_t i = link.ends.a;
      const auto [a, b] = s.passive[i].ends;
      s.opening[i] = s.x[a] - s.x[b];
      s.rush[i] = s.v[a] - s.v[b] - s.yield[i];
      row[2] = s.pushed[i];  // where looking for it begins
      row += passive_rows;
    }
    ModalBody<T> body{s, w};
    if (!push_straight(s, body)) {
      correct(*s.active, s.memory, s.numbers, body);
    }
    s.pulls = true;
    std::fill_n(s.shove, s.held_places, T(0));
    bool pushes = false;
    for (const PassiveLink& link : s.active->links) {
      const std::uint32_t i = link.ends.a;
      const T force = s.pushed[i];
      s.yield_step[i] = -s.yield[i] - s.slack[i] * force;
      s.yield[i] = -s.slack[i] * force;
      pushes |= force != 0;
      shove(s.passive[i].ends.a, -force);
      shove(s.passive[i].ends.b, force);
    }
    for (std::size_t r = 0; pushes && r < s.held_places; ++r) {
      const T way = moved(s.place_of[r]);
      s.x[s.place_of[r]] -= way;
      s.v[s.place_of[r]] -= way;
    }
    for (std::size_t o = 0; pushes && o < outputs; ++o) {
      s.heard[o] -= moved(places + o);
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
    for (const PassiveLink& link : s.active->links) {
      sum += s.reply[listener * s.passives + link.ends.a] * s.pushed[link.ends.a];
    }
    return this->inverse_mass() * sum;
  }
  void shove(std::uint32_t end, T force) {
    s.exerted[end] += force;
    if (end < places) {
      const T kick = this->inverse_mass() * force;
      s.shove[s.row_of[end]] += kick;
      s.kicked[end] += absolute(kick);
    }
  }
  void move_by_shoves() {
    if (s.awake < modes.modes) {
      this->wake();
      if (s.held_places + s.pushing <= most_kicked) {
        bundle<Crossed>(s, s.bundled);
      }
    }
    if (!s.shoves_later) {
      shove_rows<Crossed>(s);
    }
  }
};

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA
