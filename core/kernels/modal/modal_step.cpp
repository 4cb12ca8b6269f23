// The modal kernel's way through a block, compiled for each instruction set.
#include "core/kernels/modal/modal_bounds.h"
#include "core/kernels/modal/modal_mix.h"
#include "core/kernels/modal/modal_sleep.h"
#include "core/laws/laws.h"

namespace ressort::RESSORT_ISA {
namespace {

constexpr std::uint32_t frames_after_touch = 256;  // until a free motion is tried again
constexpr std::uint32_t nowhere = 0xffffffffu;

template <class T>
struct Player : Mixer<T> {
  using Mixer<T>::modes;
  using Mixer<T>::s;
  using Mixer<T>::coefficient;
  using Mixer<T>::inverse_mass;
  using Mixer<T>::mix;
  const Program& program;
  const Block<T>& block;
  const std::size_t places = modes.places.size();
  const std::size_t pushes = modes.pushes.size();
  const std::size_t outputs = modes.outputs.size();
  const std::size_t inputs = program.inputs.size();

  // Parts in which every sample moves the coefficients, or none does.
  void play() {
    for (std::size_t at = 0; at < block.frames;) {
      const std::size_t left = block.frames - at;
      const std::size_t moving = this->moving_frames();
      std::size_t frames = moving > 0 && moving < left ? moving : left;
      if (moving > 0) {
        wake();
        if (modes.is_exact) {
          frames = this->begin_exact(frames);
        }
        hold_all();
        play_bound<true>(at, frames);
        s.is_stale = true;
      } else if (s.silence > 0) {
        frames = frames < s.until_check || is_held() ? frames : s.until_check;
        play_steady(at, frames);
        settle(at + frames - 1, frames);
      } else {
        play_steady(at, frames);
      }
      at += frames;
    }
  }

  void wake() {
    if (s.awake < modes.modes) {
      stay_awake(s, modes.modes);
      s.until_check = check_frames;
      s.is_long_check = false;
    }
  }
  // Lets modes sleep that are neither pushed nor held after frame `last`.
  void settle(std::size_t last, std::size_t frames) {
    s.until_check -= frames < s.until_check ? static_cast<std::uint32_t>(frames) : s.until_check;
    if (s.until_check > 0) {
      return;
    }
    find_pushes(last, 1);
    if (s.pushing == 0 && !is_held()) {
      check_sleep(s, places, places + outputs);
    }
    s.until_check = s.is_long_check ? long_check_frames : check_frames;
  }

  void play_steady(std::size_t first, std::size_t frames) {
    if (s.is_stale) {
      mix(0, s.k, s.z);
      s.has_bounds = measure_compliance(s, places);
      if (s.silence > 0) {
        measure_ringing(s);
      }
      s.is_stale = false;
    }
    for (std::size_t n = first; n < first + frames; ++n) {
      fill_amplitudes(n);
    }
    find_pushes(first, frames);
    if (s.pushing > 0) {
      wake();
    }
    if (s.touched_frames > 0 || is_held() || !play_free(first, frames)) {
      play_touched(first, frames);
    }
  }

  // What acts on the modes from outside in this sample.
  void fill_amplitudes(std::size_t frame) {
    const T w = inverse_mass();
    const T* const value = block.value + frame * inputs;
    const T* const velocity = block.velocity + frame * inputs;
    for (std::size_t j = 0; j < pushes; ++j) {
      const ModalPush& push = modes.pushes[j];
      T now = 0;
      switch (push.by) {
        case ModalPush::By::force:
          now = value[push.input];
          break;
        case ModalPush::By::position:
          now = coefficient(push.stiffness) * (value[push.input] - static_cast<T>(push.start)) +
                coefficient(push.damping) * velocity[push.input];
          break;
        case ModalPush::By::constant:
        case ModalPush::By::late:
          now = coefficient(push.stiffness);
          break;
      }
      const bool is_late = push.by == ModalPush::By::position || push.by == ModalPush::By::late;
      s.amplitude[frame * pushes + j] = w * (is_late ? s.late[j] : now);
      s.late[j] = now;
    }
  }
  bool is_silent(std::size_t push, std::size_t first, std::size_t frames) const {
    for (std::size_t n = first; n < first + frames; ++n) {
      if (s.amplitude[n * pushes + push] != 0) {
        return false;
      }
    }
    return true;
  }
  void find_pushes(std::size_t first, std::size_t frames) {
    s.pushing = 0;
    for (std::uint32_t j = 0; j < pushes; ++j) {
      if (!is_silent(j, first, frames)) {
        s.push_of[s.pushing++] = j;
      }
    }
  }

  // --- where things can be --------------------------------------------------------------------

  T position_of(std::uint32_t end, std::size_t n) const {
    const ModalEnd& other = modes.ends[end - places];
    return other.follows ? block.value[n * inputs + other.input]
                         : static_cast<T>(program.position[other.node]);
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

  Range<T> range_of(std::uint32_t end, std::size_t first, std::size_t frames, T norm) const {
    if (end < places) {
      const T reach = T(1.001) * norm * std::sqrt(s.compliance[end]);
      const T rest = static_cast<T>(modes.places[end].rest);
      return {rest - reach, rest + reach};
    }
    Range<T> range{position_of(end, first), position_of(end, first)};
    for (std::size_t n = first + 1; n < first + frames && modes.ends[end - places].follows; ++n) {
      const T x = position_of(end, n);
      range.low = range.low > x ? x : range.low;
      range.high = x > range.high ? x : range.high;
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

  // --- sample by sample -----------------------------------------------------------------------

  // Only the links that can act with twice the norm are looked at, what links bring in being as in
  // the last block; if it becomes more than that, the block is played again with all.
  void play_touched(std::size_t first, std::size_t frames) {
    const T norm = greatest_norm(first, frames);
    const T most = 2 * (norm + s.kick_norm);
    if (s.has_bounds && s.surprised_frames == 0 && most > 0) {
      hold_some(first, frames, most);
    } else {
      hold_all();
    }
    const bool is_whole = s.held_links == s.links;
    if (!is_whole) {
      save();
    }
    play_bound<false>(first, frames);
    const auto passed = static_cast<std::uint32_t>(frames);
    s.surprised_frames -= passed < s.surprised_frames ? passed : s.surprised_frames;
    if (!is_whole && !(norm + s.kick_norm <= most)) {
      s.surprised_frames = frames_after_touch;
      restore();
      hold_all();
      play_bound<false>(first, frames);
    }
  }
  void save() {
    s.saved_awake = s.awake;
    keep(s, s.saved_q, s.q);
    keep(s, s.saved_d, s.d);
    for (std::size_t p = 0; p < places; ++p) {
      s.saved_force[p] = s.force[p];
    }
  }
  void restore() {
    keep(s, s.q, s.saved_q);
    keep(s, s.d, s.saved_d);
    stay_awake(s, s.saved_awake);
    for (std::size_t p = 0; p < places; ++p) {
      s.force[p] = s.saved_force[p];
    }
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
    for (std::size_t p = 0; p < places; ++p) {
      s.row_of[p] = nowhere;
    }
    s.held_links = 0;
    s.links = 0;
    s.held_places = 0;
    for (std::size_t h = 0; h < modes.holds.size(); ++h) {
      const ModalHold& hold = modes.holds[h];
      s.held[h] = 0;
      for (std::size_t i = 0; i < hold.a.size(); ++i, ++s.links) {
        if (condition(program.link_runs[hold.run], hold.a[i], hold.b[i])) {
          s.held_give[s.held_links] = hold.give.empty() ? T(0) : static_cast<T>(hold.give[i]);
          s.held_ends[s.held_links++] = {hold.a[i], hold.b[i]};
          ++s.held[h];
          hold_place(hold.a[i]);
          hold_place(hold.b[i]);
        }
      }
    }
  }
  void hold_place(std::uint32_t end) {
    if (end < places && s.row_of[end] == nowhere) {
      s.row_of[end] = s.held_places;
      s.place_of[s.held_places++] = end;
    }
  }

  template <bool Moving>
  void play_bound(std::size_t first, std::size_t frames) {
    locate_places();
    choose_rows<Moving>();
    bool acts = false;
    for (std::size_t n = first; n < first + frames; ++n) {
      if constexpr (Moving) {
        advance(s.ramps);
        if (modes.is_exact) {
          this->advance_exact();
        } else {
          mix(0, s.k, s.z);
        }
        fill_amplitudes(n);
      }
      move_modes(n);
      move_ends(n);
      acts |= act();
      hear(n);
    }
    s.kick_norm = 0;
    for (std::size_t p = 0; p < places; ++p) {
      s.kick_norm += norm_of_kicks(s.kicked[p], s.place_norm[p]);
    }
    const auto passed = static_cast<std::uint32_t>(frames);
    s.touched_frames = acts                        ? frames_after_touch
                       : s.touched_frames > passed ? s.touched_frames - passed
                                                   : 0;
  }

  void locate_places() {
    for (std::size_t p = 0; p < places; ++p) {
      s.kicked[p] = 0;
      if (s.row_of[p] != nowhere) {
        s.x[p] = static_cast<T>(modes.places[p].rest) + along(s, s.places + p * s.stride, s.q);
      }
    }
  }

  // The rows of a sample's sweep: places, pushes that push, and outputs.
  template <bool Moving>
  void choose_rows() {
    if (Moving) {
      for (s.pushing = 0; s.pushing < pushes; ++s.pushing) {
        s.push_of[s.pushing] = static_cast<std::uint32_t>(s.pushing);
      }
    }
    std::size_t rows = 0;
    for (std::size_t r = 0; r < s.held_places; ++r) {
      s.rows[rows++] = s.places + s.place_of[r] * s.stride;
    }
    for (std::size_t r = 0; r < s.pushing; ++r) {
      s.rows[rows++] = s.pushes + s.push_of[r] * s.stride;
    }
    for (std::size_t o = 0; o < outputs; ++o) {
      s.rows[rows++] = s.outputs + o * s.stride;
    }
    if (s.held_places + s.pushing <= most_kicked) {
      bundle(s, s.held_places + s.pushing + heard_along());
    }
  }
  // How many outputs a sweep takes along; the others have sweeps of their own.
  std::size_t heard_along() const { return outputs < 2 ? outputs : 2; }

  void move_modes(std::size_t n) {
    const T w = inverse_mass();
    const std::size_t kicked = s.held_places + s.pushing;
    bool acts = false;
    for (std::size_t r = 0; r < s.held_places; ++r) {
      const std::uint32_t p = s.place_of[r];
      s.kick[r] = w * s.force[p];
      acts |= s.kick[r] != 0;
      s.kicked[p] += absolute(s.kick[r]);
    }
    for (std::size_t r = 0; r < s.pushing; ++r) {
      s.kick[s.held_places + r] = s.amplitude[n * pushes + s.push_of[r]];
    }
    if (acts && s.awake < modes.modes) {
      wake();
      if (kicked <= most_kicked) {
        bundle(s, s.bundled);
      }
    }
    if (kicked > most_kicked) {
      sweep_rows(s, kicked, outputs);
      return;
    }
    sweep_sample(s, kicked, heard_along());
    for (std::size_t o = heard_along(); o < outputs; ++o) {
      s.heard[o] = along(s, s.outputs + o * s.stride, s.q);
    }
  }

  void move_ends(std::size_t n) {
    for (std::size_t r = 0; r < s.held_places; ++r) {
      const std::uint32_t p = s.place_of[r];
      s.v[p] = s.speed[r];
      s.x[p] += s.v[p];
      s.force[p] = 0;
    }
    for (std::size_t i = 0; i < modes.ends.size(); ++i) {
      if (modes.ends[i].follows) {
        s.x[places + i] = block.value[n * inputs + modes.ends[i].input];
        s.v[places + i] = block.velocity[n * inputs + modes.ends[i].input];
      }
    }
  }

  // The nonlinear links; whether any acts.
  bool act() {
    bool acts = false;
    const Ends* ends = s.held_ends;
    const T* give = s.held_give;
    for (std::size_t h = 0; h < modes.holds.size(); ++h) {
      const LinkRun& run = program.link_runs[modes.holds[h].run];
      const auto c = [&](std::size_t i) { return coefficient(run.coefficients[i]); };
      with_law<T>(run.law, c, [&](const auto& law) {
        for (std::size_t i = 0; i < s.held[h]; ++i, ++ends, ++give) {
          const auto [a, b] = *ends;
          const T d = s.x[a] - s.x[b];
          T f = law.force(d, s.v[a] - s.v[b]);
          if (*give > 0) {
            f *= share_of_give(law, d, *give / coefficient(modes.give_by));
          }
          acts |= f != 0;
          s.force[a] -= f;
          s.force[b] += f;
        }
      });
    }
    return acts;
  }

  void hear(std::size_t n) {
    for (std::size_t o = 0; o < outputs; ++o) {
      const ModalOutput& output = modes.outputs[o];
      block.outputs[n * outputs + o] = output.is_place
                                           ? static_cast<T>(output.place.rest) + s.heard[o]
                                           : position_of(output.end, n);
    }
  }

  // --- as long as nothing touches -------------------------------------------------------------

  bool is_held() const {
    for (std::size_t p = 0; p < places; ++p) {
      if (s.force[p] != 0) {
        return true;
      }
    }
    return false;
  }

  // The whole block, a few samples at a time, if no link acts in it; else nothing has happened.
  bool play_free(std::size_t first, std::size_t frames) {
    std::size_t rows = 0;
    for (std::size_t o = 0; o < outputs; ++o) {
      if (modes.outputs[o].is_place) {
        s.rows[rows++] = s.outputs + o * s.stride;
      }
    }
    const std::size_t heard = rows;
    if (s.pushing > 2 || (!modes.holds.empty() && !find_suspects(first, frames, rows)) ||
        rows > most_heard) {
      return false;
    }
    if (rows > heard) {
      save();
    }
    run_modes(first, frames, rows);
    if (rows > heard && !is_untouched(first, frames)) {
      restore();
      return false;
    }
    write_outputs(first, frames);
    return true;
  }

  // Adds the places to the rows whose links may act. False where one acts for sure.
  bool find_suspects(std::size_t first, std::size_t frames, std::size_t& rows) {
    for (std::size_t p = 0; p < places; ++p) {
      s.row_of[p] = nowhere;
    }
    const T norm = greatest_norm(first, frames);
    for (const ModalHold& hold : modes.holds) {
      const LinkRun& run = program.link_runs[hold.run];
      for (std::size_t i = 0; i < hold.a.size(); ++i) {
        if (!may_act_within(run, hold.a[i], hold.b[i], first, frames, norm)) {
          continue;
        }
        if (!lets_go(run.law)) {
          return false;
        }
        suspect(hold.a[i], rows);
        suspect(hold.b[i], rows);
      }
    }
    return true;
  }
  void suspect(std::uint32_t end, std::size_t& rows) {
    if (end < places && s.row_of[end] == nowhere) {
      s.row_of[end] = static_cast<std::uint32_t>(rows);
      s.rows[rows++] = s.places + end * s.stride;
    }
  }

  // After a free motion: whether it met no link.
  bool is_untouched(std::size_t first, std::size_t frames) const {
    const auto is_seen = [&](std::uint32_t end) {
      return end >= places || s.row_of[end] != nowhere;
    };
    const auto position = [&](std::uint32_t end, std::size_t n) {
      return end >= places ? position_of(end, first + n)
                           : static_cast<T>(modes.places[end].rest) +
                                 s.seen[s.row_of[end] * max_block_frames + n];
    };
    for (const ModalHold& hold : modes.holds) {
      for (std::size_t i = 0; i < hold.a.size(); ++i) {
        const std::uint32_t a = hold.a[i];
        const std::uint32_t b = hold.b[i];
        if (!is_seen(a) || !is_seen(b)) {
          continue;
        }
        Range<T> d{std::numeric_limits<T>::infinity(), -std::numeric_limits<T>::infinity()};
        for (std::size_t n = 0; n < frames; ++n) {
          const T apart = position(a, n) - position(b, n);
          d.low = d.low > apart ? apart : d.low;
          d.high = apart > d.high ? apart : d.high;
        }
        if (may_act<T>(program.link_runs[hold.run], s.ramps.value, d)) {
          return false;
        }
      }
    }
    return true;
  }

  void run_modes(std::size_t first, std::size_t frames, std::size_t rows) {
    switch (s.pushing) {
      case 0:
        return run_heard<0>(first, frames, rows);
      case 1:
        return run_heard<1>(first, frames, rows);
      default:
        return run_heard<2>(first, frames, rows);
    }
  }
  // As many samples at a time as there are registers for what is heard in them.
  template <std::size_t Kicked>
  void run_heard(std::size_t first, std::size_t frames, std::size_t rows) {
    if (rows <= 1) {
      run<4, Kicked, 1>(first, frames, rows);
    } else if (rows <= 2) {
      run<4, Kicked, 2>(first, frames, rows);
    } else if (rows <= 4) {
      run<2, Kicked, 4>(first, frames, rows);
    } else {
      run<1, Kicked, most_heard>(first, frames, rows);
    }
  }
  template <std::size_t Samples, std::size_t Kicked, std::size_t Heard>
  void run(std::size_t first, std::size_t frames, std::size_t rows) {
    for (std::size_t r = Heard; r-- > 0;) {
      s.rows[Kicked + r] = r < rows ? s.rows[r] : nullptr;
    }
    for (std::size_t r = 0; r < Kicked; ++r) {
      s.rows[r] = s.pushes + s.push_of[r] * s.stride;
    }
    bundle(s, Kicked + Heard);
    std::size_t n = 0;
    for (; n + Samples <= frames; n += Samples) {
      run_samples<Samples, Kicked, Heard>(first, n, rows);
    }
    for (; n < frames; ++n) {
      run_samples<1, Kicked, Heard>(first, n, rows);
    }
  }
  template <std::size_t Samples, std::size_t Kicked, std::size_t Heard>
  void run_samples(std::size_t first, std::size_t n, std::size_t rows) {
    for (std::size_t m = 0; m < Samples; ++m) {
      for (std::size_t r = 0; r < Kicked; ++r) {
        s.kick[m * Kicked + r] = s.amplitude[(first + n + m) * pushes + s.push_of[r]];
      }
    }
    sweep<Samples, Kicked, false, Heard>(s);
    for (std::size_t m = 0; m < Samples; ++m) {
      for (std::size_t r = 0; r < rows; ++r) {
        s.seen[r * max_block_frames + n + m] = s.heard[m * Heard + r];
      }
    }
  }

  void write_outputs(std::size_t first, std::size_t frames) {
    std::size_t row = 0;
    for (std::size_t o = 0; o < outputs; ++o) {
      const ModalOutput& output = modes.outputs[o];
      T* out = block.outputs + first * outputs + o;
      const T* const seen = s.seen + row * max_block_frames;
      const T rest = static_cast<T>(output.place.rest);
      for (std::size_t n = 0; n < frames; ++n, out += outputs) {
        *out = output.is_place ? rest + seen[n] : position_of(output.end, first + n);
      }
      row += output.is_place;
    }
  }
};

template <class T>
void step(const Program& program, const Modes& modes, ModalState<T>& state, const Block<T>& block) {
  Player<T>{{modes, state}, program, block}.play();
}

}  // namespace
}  // namespace ressort::RESSORT_ISA

namespace ressort {

template <>
ModalStep<float> modal_step<Isa::RESSORT_ISA, float>() {
  return RESSORT_ISA::step<float>;
}

template <>
ModalStep<double> modal_step<Isa::RESSORT_ISA, double>() {
  return RESSORT_ISA::step<double>;
}

}  // namespace ressort
