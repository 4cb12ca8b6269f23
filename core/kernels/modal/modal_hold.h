// core/kernels: which links are computed on the modes of a ModalState, and where their ends can be;
// a part of modal_step.cpp, which alone includes it.
#pragma once

#include "core/kernels/modal/modal_bounds.h"
#include "core/kernels/modal/modal_mix.h"
#include "core/kernels/modal/modal_sleep.h"
#include "core/laws/laws.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

constexpr std::uint32_t frames_after_touch = 256;  // until a free motion is tried again
constexpr std::uint32_t nowhere = 0xffffffffu;

template <class T, bool Crossed>
struct Holder : ModeMixer<T, Crossed> {
  using ModeMixer<T, Crossed>::modes;
  using ModeMixer<T, Crossed>::s;
  const Program& program;
  const Block<T>& block;
  const std::size_t places = modes.places.size();
  const std::size_t pushes = modes.pushes.size();
  const std::size_t outputs = modes.outputs.size();
  const std::size_t inputs = program.inputs.size();

  void wake() {
    if (s.awake < modes.modes) {
      stay_awake(s, modes.modes);
      s.until_check = check_frames;
      s.is_long_check = false;
    }
  }
  // Whether a link has pulled in the last sample.
  bool is_held() const {
    for (std::size_t p = 0; p < places; ++p) {
      if (s.force[p] != 0) {
        return true;
      }
    }
    return s.is_pushed;
  }

  // --- where things can be --------------------------------------------------------------------

  T position_of(std::uint32_t end, std::size_t n) const {
    const ModalEnd& other = modes.ends[end - places];
    return other.follows ? block.value[n * inputs + other.input]
                         : static_cast<T>(program.position[other.node]);
  }

  // What is no mass takes its place.
  void move_ends(std::size_t n) {
    for (std::size_t i = 0; i < modes.ends.size(); ++i) {
      if (modes.ends[i].follows) {
        s.x[places + i] = block.value[n * inputs + modes.ends[i].input];
        s.v[places + i] = block.velocity[n * inputs + modes.ends[i].input];
      }
    }
  }

  // The norm that the modes have at most in this block, without what links do.
  T greatest_norm(std::size_t first, std::size_t frames) const {
    T norm = std::sqrt(energy(s));
    for (std::size_t j = 0; j < pushes; ++j) {
      T sum = 0;
      for (std::size_t n = first; n < first + frames; ++n) {
        sum += absolute(s.amplitude[n * pushes + j]);
      }
      norm += norm_of_kicks(sum, s.push_norm[j]);
    }
    return norm;
  }

  // Where an end can be in a block, and in the two samples before it.
  Range<T> range_of(std::uint32_t end, std::size_t first, std::size_t frames, T norm) const {
    if (end < places) {
      const T reach = T(1.001) * norm * std::sqrt(s.compliance[end]);
      const T rest = static_cast<T>(modes.places[end].rest);
      return {rest - reach, rest + reach};
    }
    Range<T> range{s.x[end], s.x[end]};
    range.take(s.x[end] - s.v[end]);
    for (std::size_t n = first; n < first + frames && modes.ends[end - places].follows; ++n) {
      range.take(position_of(end, n));
    }
    return range;
  }
  bool may_act_within(const LinkRun& run, std::uint32_t a, std::uint32_t b, std::size_t first,
                      std::size_t frames, T norm) const {
    if (!s.has_bounds) {
      return true;
    }
    const Range<T> at = range_of(a, first, frames, norm);
    const Range<T> to = range_of(b, first, frames, norm);
    return may_act<T>(run, s.ramps.value, {at.low - to.high, at.high - to.low});
  }

  // --- what is computed -----------------------------------------------------------------------

  // Everything that a block may change, but for what is counted.
  void save() {
    s.saved_awake = s.awake;
    keep(s, s.saved_q, s.q);
    keep(s, s.saved_d, s.d);
    std::copy_n(s.force, places, s.saved_force);
    std::copy_n(s.x, places + modes.ends.size(), s.saved_x);
    std::copy_n(s.v, places + modes.ends.size(), s.saved_v);
    std::copy_n(s.yield, s.passives, s.saved_yield);
    std::copy_n(s.yield_step, s.passives, s.saved_yield_step);
    s.saved_pulls = s.pulls;
  }
  void restore() {
    keep(s, s.q, s.saved_q);
    keep(s, s.d, s.saved_d);
    stay_awake(s, s.saved_awake);
    std::copy_n(s.saved_force, places, s.force);
    std::copy_n(s.saved_x, places + modes.ends.size(), s.x);
    std::copy_n(s.saved_v, places + modes.ends.size(), s.v);
    std::copy_n(s.saved_yield, s.passives, s.yield);
    std::copy_n(s.saved_yield_step, s.passives, s.yield_step);
    s.pulls = s.saved_pulls;
  }

  void hold_all() {
    hold_if([](const LinkRun&, std::uint32_t, std::uint32_t) { return true; });
  }
  void hold_some(std::size_t first, std::size_t frames, T norm) {
    hold_if([&](const LinkRun& run, std::uint32_t a, std::uint32_t b) {
      return (a < places && s.force[a] != 0) || (b < places && s.force[b] != 0) ||
             may_act_within(run, a, b, first, frames, norm);
    });
  }
  // Chooses the links that are computed and the places that they need.
  template <class Condition>
  void hold_if(Condition&& condition) {
    std::fill_n(s.row_of, places, nowhere);
    s.held_links = 0;
    s.links = 0;
    s.held_places = 0;
    s.active->links.clear();
    std::uint32_t passive = 0;
    std::size_t plain = 0;
    for (std::size_t h = 0; h < modes.holds.size(); ++h) {
      const ModalHold& hold = modes.holds[h];
      const LinkRun& run = program.link_runs[hold.run];
      const bool is_plain = run.scheme == Scheme::plain;
      s.held[h] = 0;
      for (std::size_t i = 0; i < hold.a.size(); ++i, ++s.links) {
        const bool is_held = condition(run, hold.a[i], hold.b[i]);
        if (is_held) {
          ++s.held_links;
          hold_place(hold.a[i]);
          hold_place(hold.b[i]);
        }
        if (is_plain && is_held) {
          s.held_give[plain] = hold.give.empty() ? T(0) : static_cast<T>(hold.give[i]);
          s.held_ends[plain++] = {hold.a[i], hold.b[i]};
          ++s.held[h];
        }
        if (!is_plain) {
          hold_passive(passive++, is_held);
        }
      }
    }
    // One alone, or all of them at once by what each moves the others.
    const std::size_t active = s.active->links.size();
    s.active->alone = active == 1 ? 1 : 0;
    s.active->clusters[0].count = active == 1 ? 0 : static_cast<std::uint32_t>(active);
  }
  void hold_place(std::uint32_t end) {
    if (end < places && s.row_of[end] == nowhere) {
      s.row_of[end] = s.held_places;
      s.place_of[s.held_places++] = end;
    }
  }
  void hold_passive(std::uint32_t link, bool is_held) {
    if (!is_held) {
      s.yield[link] = s.yield_step[link] = s.pushed[link] = 0;
      return;
    }
    s.active->links.push_back(s.passive[link]);
    s.active->links.back().ends = {link, nowhere};
  }
};

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA
