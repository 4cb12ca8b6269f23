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
    if (s.sleep.awake < modes.modes) {
      stay_awake(s, modes.modes);
      s.sleep.until_check = check_frames;
      s.sleep.is_long_check = false;
    }
  }
  // Whether a link has pulled in the last sample.
  bool is_held() const {
    for (std::size_t p = 0; p < places; ++p) {
      if (s.ends.force[p] != 0) {
        return true;
      }
    }
    return s.passive.is_pushed;
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
        s.ends.x[places + i] = block.value[n * inputs + modes.ends[i].input];
        s.ends.v[places + i] = block.velocity[n * inputs + modes.ends[i].input];
      }
    }
  }

  // The norm that the modes have at most in this block, without what links do.
  T greatest_norm(std::size_t first, std::size_t frames) const {
    T norm = std::sqrt(energy(s));
    for (std::size_t j = 0; j < pushes; ++j) {
      T sum = 0;
      for (std::size_t n = first; n < first + frames; ++n) {
        sum += absolute(s.inputs.amplitude[n * pushes + j]);
      }
      norm += norm_of_kicks(sum, s.shapes.push_norm[j]);
    }
    return norm;
  }

  // Where an end can be in a block, and in the two samples before it.
  Range<T> range_of(std::uint32_t end, std::size_t first, std::size_t frames, T norm) const {
    if (end < places) {
      const T reach = T(1.001) * norm * std::sqrt(s.ends.compliance[end]);
      const T rest = static_cast<T>(modes.places[end].rest);
      return {rest - reach, rest + reach};
    }
    Range<T> range{s.ends.x[end], s.ends.x[end]};
    range.take(s.ends.x[end] - s.ends.v[end]);
    for (std::size_t n = first; n < first + frames && modes.ends[end - places].follows; ++n) {
      range.take(position_of(end, n));
    }
    return range;
  }
  bool may_act_within(const LinkRun& run, std::uint32_t a, std::uint32_t b, std::size_t first,
                      std::size_t frames, T norm) const {
    if (!s.ends.has_bounds) {
      return true;
    }
    const Range<T> at = range_of(a, first, frames, norm);
    const Range<T> to = range_of(b, first, frames, norm);
    return may_act<T>(run, s.ramps.value, {at.low - to.high, at.high - to.low});
  }

  // --- what is computed -----------------------------------------------------------------------

  // Everything that a block may change, but for what is counted.
  void save() {
    s.saved.awake = s.sleep.awake;
    keep(s, s.saved.q, s.motion.q);
    keep(s, s.saved.d, s.motion.d);
    std::copy_n(s.ends.force, places, s.saved.force);
    std::copy_n(s.ends.x, places + modes.ends.size(), s.saved.x);
    std::copy_n(s.ends.v, places + modes.ends.size(), s.saved.v);
    std::copy_n(s.passive.yield, s.passive.count, s.saved.yield);
    std::copy_n(s.passive.yield_step, s.passive.count, s.saved.yield_step);
    s.saved.pulls = s.passive.pulls;
  }
  void restore() {
    keep(s, s.motion.q, s.saved.q);
    keep(s, s.motion.d, s.saved.d);
    stay_awake(s, s.saved.awake);
    std::copy_n(s.saved.force, places, s.ends.force);
    std::copy_n(s.saved.x, places + modes.ends.size(), s.ends.x);
    std::copy_n(s.saved.v, places + modes.ends.size(), s.ends.v);
    std::copy_n(s.saved.yield, s.passive.count, s.passive.yield);
    std::copy_n(s.saved.yield_step, s.passive.count, s.passive.yield_step);
    s.passive.pulls = s.saved.pulls;
  }

  void hold_all() {
    hold_if([](const LinkRun&, std::uint32_t, std::uint32_t) { return true; });
  }
  void hold_some(std::size_t first, std::size_t frames, T norm) {
    hold_if([&](const LinkRun& run, std::uint32_t a, std::uint32_t b) {
      return (a < places && s.ends.force[a] != 0) || (b < places && s.ends.force[b] != 0) ||
             may_act_within(run, a, b, first, frames, norm);
    });
  }
  // Chooses the links that are computed and the places that they need.
  template <class Condition>
  void hold_if(Condition&& condition) {
    std::fill_n(s.held.row_of, places, nowhere);
    s.held.links = 0;
    s.held.all_links = 0;
    s.held.places = 0;
    s.passive.active->links.clear();
    std::uint32_t passive = 0;
    std::size_t plain = 0;
    for (std::size_t h = 0; h < modes.holds.size(); ++h) {
      const ModalHold& hold = modes.holds[h];
      const LinkRun& run = program.link_runs[hold.run];
      const bool is_plain = run.scheme == Scheme::plain;
      s.held.count_of[h] = 0;
      for (std::size_t i = 0; i < hold.a.size(); ++i, ++s.held.all_links) {
        const bool is_held = condition(run, hold.a[i], hold.b[i]);
        if (is_held) {
          ++s.held.links;
          hold_place(hold.a[i]);
          hold_place(hold.b[i]);
        }
        if (is_plain && is_held) {
          s.held.give[plain] = hold.give.empty() ? T(0) : static_cast<T>(hold.give[i]);
          s.held.ends[plain++] = {hold.a[i], hold.b[i]};
          ++s.held.count_of[h];
        }
        if (!is_plain) {
          hold_passive(passive++, is_held);
        }
      }
    }
    // One alone, or all of them at once by what each moves the others.
    const std::size_t active = s.passive.active->links.size();
    s.passive.active->alone = active == 1 ? 1 : 0;
    s.passive.active->clusters[0].count = active == 1 ? 0 : static_cast<std::uint32_t>(active);
  }
  void hold_place(std::uint32_t end) {
    if (end < places && s.held.row_of[end] == nowhere) {
      s.held.row_of[end] = s.held.places;
      s.held.place_of[s.held.places++] = end;
    }
  }
  void hold_passive(std::uint32_t link, bool is_held) {
    if (!is_held) {
      s.passive.yield[link] = s.passive.yield_step[link] = s.passive.pushed[link] = 0;
      return;
    }
    s.passive.active->links.push_back(s.passive.links[link]);
    s.passive.active->links.back().ends = {link, nowhere};
  }
};

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA
