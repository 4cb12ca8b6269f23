// The modal kernel's way through a block, compiled for each instruction set.
#include "core/kernels/modal/modal_passive.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

template <class T, bool Crossed>
struct Player : Presser<T, Crossed> {
  using Base = Presser<T, Crossed>;
  using Base::block;
  using Base::coefficient;
  using Base::greatest_norm;
  using Base::hold_all;
  using Base::hold_some;
  using Base::inputs;
  using Base::inverse_mass;
  using Base::is_held;
  using Base::may_act_within;
  using Base::mix;
  using Base::modes;
  using Base::move_ends;
  using Base::outputs;
  using Base::places;
  using Base::position_of;
  using Base::presses;
  using Base::program;
  using Base::pushes;
  using Base::restore;
  using Base::s;
  using Base::save;
  using Base::wake;

  // Parts in which every sample moves the coefficients, or none does.
  void play() {
    for (std::size_t at = 0; at < block.frames;) {
      const std::size_t left = block.frames - at;
      const std::size_t moving = this->moving_frames();
      std::size_t frames = moving > 0 && moving < left ? moving : left;
      if (moving > 0) {
        wake();
        if (modes.is_exact && !Crossed) {
          frames = this->begin_exact(frames);
        }
        hold_all();
        play_bound<true>(at, frames);
        s.motion.is_stale = true;
      } else if (s.sleep.silence > 0) {
        frames = frames < s.sleep.until_check || is_held() ? frames : s.sleep.until_check;
        play_steady(at, frames);
        settle(at + frames - 1, frames);
      } else {
        play_steady(at, frames);
      }
      at += frames;
    }
  }

  // Lets modes sleep that are neither pushed nor held after frame `last`.
  void settle(std::size_t last, std::size_t frames) {
    s.sleep.until_check -=
        frames < s.sleep.until_check ? static_cast<std::uint32_t>(frames) : s.sleep.until_check;
    if (s.sleep.until_check > 0) {
      return;
    }
    find_pushes(last, 1);
    if (s.inputs.pushing == 0 && !is_held()) {
      check_sleep(s, places, places + outputs);
    }
    s.sleep.until_check = s.sleep.is_long_check ? long_check_frames : check_frames;
  }

  void play_steady(std::size_t first, std::size_t frames) {
    if (s.motion.is_stale) {
      mix(0, s.motion.k, s.motion.z);
      this->mix_forces();
      s.ends.has_bounds = !Crossed && measure_compliance(s, places);
      if (s.sleep.silence > 0) {
        measure_ringing(s);
      }
      s.motion.is_stale = false;
    }
    for (std::size_t n = first; n < first + frames; ++n) {
      fill_amplitudes(n);
    }
    find_pushes(first, frames);
    if (s.inputs.pushing > 0) {
      wake();
    }
    if (s.held.touched_frames > 0 || is_held() || !play_free(first, frames)) {
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
      s.inputs.amplitude[frame * pushes + j] = w * (is_late ? s.inputs.late[j] : now);
      s.inputs.late[j] = now;
    }
  }
  bool is_silent(std::size_t push, std::size_t first, std::size_t frames) const {
    for (std::size_t n = first; n < first + frames; ++n) {
      if (s.inputs.amplitude[n * pushes + push] != 0) {
        return false;
      }
    }
    return true;
  }
  void find_pushes(std::size_t first, std::size_t frames) {
    s.inputs.pushing = 0;
    for (std::uint32_t j = 0; j < pushes; ++j) {
      if (!is_silent(j, first, frames)) {
        s.inputs.push_of[s.inputs.pushing++] = j;
      }
    }
  }

  // --- sample by sample -----------------------------------------------------------------------

  // Only the links that can act with twice the norm are looked at, what links bring in being as in
  // the last block; if it becomes more than that, the block is played again with all.
  void play_touched(std::size_t first, std::size_t frames) {
    const T norm = greatest_norm(first, frames);
    const T most = 2 * (norm + s.ends.kick_norm);
    if (s.ends.has_bounds && s.held.surprised_frames == 0 && most > 0) {
      hold_some(first, frames, most);
    } else {
      hold_all();
    }
    const bool is_whole = s.held.links == s.held.all_links;
    if (!is_whole) {
      save();
    }
    play_bound<false>(first, frames);
    const auto passed = static_cast<std::uint32_t>(frames);
    s.held.surprised_frames -= passed < s.held.surprised_frames ? passed : s.held.surprised_frames;
    if (!is_whole && !(norm + s.ends.kick_norm <= most)) {
      s.held.surprised_frames = frames_after_touch;
      restore();
      hold_all();
      play_bound<false>(first, frames);
    }
  }
  template <bool Moving>
  void play_bound(std::size_t first, std::size_t frames) {
    locate_places();
    choose_rows<Moving>();
    if (presses()) {
      this->measure_passive();
    }
    s.passive.shoves_later = !Moving && this->may_shove_later();
    std::fill_n(s.passive.shove, s.held.places, T(0));
    bool acts = false;
    for (std::size_t n = first; n < first + frames; ++n) {
      if constexpr (Moving) {
        advance(s.ramps);
        if (modes.is_exact && !Crossed) {
          this->advance_exact();
        } else {
          mix(0, s.motion.k, s.motion.z);
        }
        this->mix_forces();
        fill_amplitudes(n);
        if (presses()) {
          this->measure_passive();
        }
      }
      if (presses()) {
        this->remember_passive();
      }
      std::fill_n(s.ends.exerted, places + modes.ends.size(), T(0));
      std::fill_n(s.ends.force + places, modes.ends.size(), T(0));
      move_modes(n);
      move_places();
      move_ends(n);
      s.passive.is_pushed = presses() && this->press();
      acts |= act() || s.passive.is_pushed;
      hear(n);
    }
    this->shove_now();
    s.ends.kick_norm = 0;
    for (std::size_t p = 0; p < places; ++p) {
      s.ends.kick_norm += norm_of_kicks(s.ends.kicked[p], s.shapes.place_norm[p]);
    }
    const auto passed = static_cast<std::uint32_t>(frames);
    s.held.touched_frames = acts                             ? frames_after_touch
                            : s.held.touched_frames > passed ? s.held.touched_frames - passed
                                                             : 0;
  }

  void locate_places() {
    for (std::uint32_t p = 0; p < places; ++p) {
      s.ends.kicked[p] = 0;
      if (s.held.row_of[p] != nowhere) {
        locate_at_first(p);
      }
    }
  }

  // Crossed modes are placed a sample ahead: until then a place is where it was put.
  void locate_at_first(std::uint32_t p) {
    if (!Crossed || *s.motion.used != 0) {
      locate(p);
    }
  }
  void locate(std::uint32_t p) {
    const std::size_t at = p * s.shapes.row;
    s.ends.x[p] = static_cast<T>(modes.places[p].rest) + read<Crossed>(s, s.shapes.places + at);
    if (Crossed || s.passive.count > 0) {
      s.ends.v[p] = Crossed ? read<Crossed>(s, s.shapes.speeds + at)
                            : along(s, s.shapes.places + at, s.motion.d);
    }
  }

  // The rows of a sample's sweep: places, pushes that push, and outputs.
  template <bool Moving>
  void choose_rows() {
    if (Moving) {
      for (s.inputs.pushing = 0; s.inputs.pushing < pushes; ++s.inputs.pushing) {
        s.inputs.push_of[s.inputs.pushing] = static_cast<std::uint32_t>(s.inputs.pushing);
      }
    }
    std::size_t rows = 0;
    for (std::size_t r = 0; r < s.held.places; ++r) {
      s.sweep.rows[rows++] = s.shapes.places + s.held.place_of[r] * s.shapes.row;
    }
    for (std::size_t r = 0; r < s.inputs.pushing; ++r) {
      s.sweep.rows[rows++] = s.shapes.pushes + s.inputs.push_of[r] * s.shapes.row;
    }
    for (std::size_t o = 0; o < outputs; ++o) {
      s.sweep.rows[rows++] = s.shapes.outputs + o * s.shapes.row;
    }
    if (s.held.places + s.inputs.pushing <= most_kicked) {
      bundle<Crossed>(s, s.held.places + s.inputs.pushing + heard_along());
    }
  }
  // How many outputs a sweep takes along; the others have sweeps of their own.
  std::size_t heard_along() const { return outputs < 2 ? outputs : 2; }

  void move_modes(std::size_t n) {
    const T w = inverse_mass();
    const std::size_t kicked = s.held.places + s.inputs.pushing;
    bool acts = false;
    for (std::size_t r = 0; r < s.held.places; ++r) {
      const std::uint32_t p = s.held.place_of[r];
      s.sweep.kick[r] = w * s.ends.force[p];
      acts |= s.sweep.kick[r] != 0;
      s.ends.kicked[p] += absolute(s.sweep.kick[r]);
    }
    for (std::size_t r = 0; r < s.inputs.pushing; ++r) {
      s.sweep.kick[s.held.places + r] = s.inputs.amplitude[n * pushes + s.inputs.push_of[r]];
    }
    if (acts && s.sleep.awake < modes.modes) {
      wake();
      if (kicked <= most_kicked) {
        bundle<Crossed>(s, s.sweep.bundled);
      }
    }
    if (kicked > most_kicked) {
      sweep_rows<Crossed>(s, kicked, outputs);
      return;
    }
    if (s.passive.shoves_later) {
      std::copy_n(s.passive.shove, kicked, s.sweep.kick);
      sweep_sample<Crossed, true>(s, kicked, heard_along());
    } else {
      sweep_sample<Crossed, false>(s, kicked, heard_along());
    }
    for (std::size_t o = heard_along(); o < outputs; ++o) {
      s.sweep.heard[o] = read<Crossed>(s, s.shapes.outputs + o * s.shapes.row);
    }
  }

  void move_places() {
    for (std::size_t r = 0; r < s.held.places; ++r) {
      const std::uint32_t p = s.held.place_of[r];
      s.ends.v[p] = s.sweep.speed[r];
      s.ends.x[p] += s.sweep.speed[r];
      if (Crossed && s.motion.is_first) {
        locate(p);
      }
      s.ends.force[p] = 0;
    }
  }

  // The plain links that are not linear; whether any acts.
  bool act() {
    bool acts = false;
    const Ends* ends = s.held.ends;
    const T* give = s.held.give;
    for (std::size_t h = 0; h < modes.holds.size(); ++h) {
      if (s.held.count_of[h] == 0) {
        continue;
      }
      const LinkRun& run = program.link_runs[modes.holds[h].run];
      const auto c = [&](std::size_t i) { return coefficient(run.coefficients[i]); };
      with_law<T>(run.law, c, [&](const auto& law) {
        for (std::size_t i = 0; i < s.held.count_of[h]; ++i, ++ends, ++give) {
          const auto [a, b] = *ends;
          const T d = s.ends.x[a] - s.ends.x[b];
          T f = law.force(d, s.ends.v[a] - s.ends.v[b]);
          if (*give > 0) {
            f *= share_of_give(law, d, *give / coefficient(modes.give_by));
          }
          acts |= f != 0;
          s.ends.force[a] -= f;
          s.ends.force[b] += f;
        }
      });
    }
    return acts;
  }

  void hear(std::size_t n) {
    std::size_t force = 0;
    for (std::size_t o = 0; o < outputs; ++o) {
      const ModalOutput& output = modes.outputs[o];
      if (output.is_force) {
        block.outputs[n * outputs + o] = force_of(output.force, force++, n);
        continue;
      }
      block.outputs[n * outputs + o] = output.is_place
                                           ? static_cast<T>(output.place.rest) + s.sweep.heard[o]
                                           : position_of(output.end, n);
    }
  }

  // What links and inputs exert at a node, once all has moved and pulled.
  T force_of(const ModalForce& force, std::size_t number, std::size_t n) const {
    const T* const row = s.forces.rows + 2 * number * s.shapes.stride;
    T sum = s.forces.still[number] +
            (Crossed ? read<Crossed>(s, row)
                     : along(s, row, s.motion.q) + along(s, row + s.shapes.stride, s.motion.d));
    const T* const value = block.value + n * inputs;
    const T* const velocity = block.velocity + n * inputs;
    for (const ModalForce::Hand& hand : force.hands) {
      sum += static_cast<T>(hand.weight) *
             (coefficient(hand.stiffness) * (value[hand.input] - static_cast<T>(hand.start)) +
              coefficient(hand.damping) * velocity[hand.input]);
    }
    for (const ModalForce::Weight& input : force.inputs) {
      sum += static_cast<T>(input.weight) * value[input.of];
    }
    for (const ModalForce::Weight& end : force.ends) {
      sum += static_cast<T>(end.weight) * (s.ends.force[end.of] + s.ends.exerted[end.of]);
    }
    return static_cast<T>(force.scale) * sum;
  }

  // --- as long as nothing touches -------------------------------------------------------------

  // The whole block, a few samples at a time, if no link acts in it; else nothing has happened.
  bool play_free(std::size_t first, std::size_t frames) {
    std::size_t rows = 0;
    for (std::size_t o = 0; o < outputs; ++o) {
      if (modes.outputs[o].is_place) {
        s.sweep.rows[rows++] = s.shapes.outputs + o * s.shapes.row;
      }
    }
    const std::size_t heard = rows;
    if (s.forces.count > 0 || s.inputs.pushing > 2 ||
        (!modes.holds.empty() && !find_suspects(first, frames, rows)) || rows > most_heard) {
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
    move_ends(first + frames - 1);
    s.passive.pulls = true;
    return true;
  }

  // Adds the places to the rows whose links may act. False where one acts for sure.
  bool find_suspects(std::size_t first, std::size_t frames, std::size_t& rows) {
    for (std::size_t p = 0; p < places; ++p) {
      s.held.row_of[p] = nowhere;
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
    if (end < places && s.held.row_of[end] == nowhere) {
      s.held.row_of[end] = static_cast<std::uint32_t>(rows);
      s.sweep.rows[rows++] = s.shapes.places + end * s.shapes.row;
      locate_at_first(end);
    }
  }

  // After a free motion: whether it met no link.
  bool is_untouched(std::size_t first, std::size_t frames) const {
    const auto is_seen = [&](std::uint32_t end) {
      return end >= places || s.held.row_of[end] != nowhere;
    };
    const auto position = [&](std::uint32_t end, std::size_t n) {
      return end >= places ? position_of(end, first + n)
                           : static_cast<T>(modes.places[end].rest) +
                                 s.sweep.seen[s.held.row_of[end] * max_block_frames + n];
    };
    for (const ModalHold& hold : modes.holds) {
      for (std::size_t i = 0; i < hold.a.size(); ++i) {
        const std::uint32_t a = hold.a[i];
        const std::uint32_t b = hold.b[i];
        if (!is_seen(a) || !is_seen(b)) {
          continue;
        }
        const LinkRun& run = program.link_runs[hold.run];
        const T first_apart = position(a, 0) - position(b, 0);
        Range<T> d{first_apart, first_apart};
        if (run.scheme != Scheme::plain) {
          const T now = s.ends.x[a] - s.ends.x[b];
          d.take(now);
          d.take(now - (s.ends.v[a] - s.ends.v[b]));
        }
        for (std::size_t n = 1; n < frames; ++n) {
          d.take(position(a, n) - position(b, n));
        }
        if (may_act<T>(run, s.ramps.value, d)) {
          return false;
        }
      }
    }
    return true;
  }

  void run_modes(std::size_t first, std::size_t frames, std::size_t rows) {
    switch (s.inputs.pushing) {
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
      s.sweep.rows[Kicked + r] = r < rows ? s.sweep.rows[r] : nullptr;
    }
    for (std::size_t r = 0; r < Kicked; ++r) {
      s.sweep.rows[r] = s.shapes.pushes + s.inputs.push_of[r] * s.shapes.row;
    }
    bundle<Crossed>(s, Kicked + Heard);
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
        s.sweep.kick[m * Kicked + r] =
            s.inputs.amplitude[(first + n + m) * pushes + s.inputs.push_of[r]];
      }
    }
    sweep<Samples, Kicked, false, Heard, Crossed, false>(s);
    for (std::size_t m = 0; m < Samples; ++m) {
      for (std::size_t r = 0; r < rows; ++r) {
        s.sweep.seen[r * max_block_frames + n + m] = s.sweep.heard[m * Heard + r];
      }
    }
  }

  void write_outputs(std::size_t first, std::size_t frames) {
    std::size_t row = 0;
    for (std::size_t o = 0; o < outputs; ++o) {
      const ModalOutput& output = modes.outputs[o];
      T* out = block.outputs + first * outputs + o;
      const T* const seen = s.sweep.seen + row * max_block_frames;
      const T rest = static_cast<T>(output.place.rest);
      for (std::size_t n = 0; n < frames; ++n, out += outputs) {
        *out = output.is_place ? rest + seen[n] : position_of(output.end, first + n);
      }
      row += output.is_place;
    }
  }
};

template <class T, bool Crossed>
void step(const Program& program, const Modes& modes, ModalState<T>& state, const Block<T>& block) {
  Player<T, Crossed>{{{{modes, state}, program, block}}}.play();
}

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA

namespace ressort::kernels {

template <>
ModalStep<float> modal_step<Isa::RESSORT_ISA, float>(bool is_crossed) {
  return is_crossed ? RESSORT_ISA::step<float, true> : RESSORT_ISA::step<float, false>;
}

template <>
ModalStep<double> modal_step<Isa::RESSORT_ISA, double>(bool is_crossed) {
  return is_crossed ? RESSORT_ISA::step<double, true> : RESSORT_ISA::step<double, false>;
}

}  // namespace ressort::kernels
