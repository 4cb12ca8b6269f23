// The modal kernel's computation of a block, compiled for each instruction set.
#include "core/kernels/modal/modal_bounds.h"
#include "core/kernels/modal/modal_exact.h"
#include "core/kernels/modal/modal_passive.h"
#include "core/kernels/modal/modal_sleep.h"
#include "core/laws/laws.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

constexpr std::uint32_t frames_after_touch =
    256;                                // frames from a contact until a free block is tried again
constexpr double most_surprise = 30.0;  // times the motion that is assumed at first
constexpr std::uint32_t nowhere = 0xffffffffu;

// Computes one block: divides it into parts with constant and with changing coefficients, decides
// for each part which links can act, and advances the modes sample by sample (bound) or in runs
// (free).
template <class T, bool Crossed>
struct ModalPlayer {
  const Modes& modes;
  ModalState<T>& s;
  const Program& program;
  const Block<T>& block;
  const std::size_t places = modes.places.size();
  const std::size_t pushes = modes.pushes.size();
  const std::size_t outputs = modes.outputs.size();
  const std::size_t inputs = program.inputs.size();

  // Bounds on the motion of the modes in a part.
  struct Motion {
    T norm;            // of the modes that are not soft, at the start
    T soft_speed = 0;  // sum over the soft modes, at the start
    T kicks;           // growth of the norm
  };

  // Plays the block in parts in which the coefficients change in every sample, or in none.
  void play() {
    std::size_t moving = moving_frames();
    for (std::size_t at = 0; at < block.frames;) {
      const std::size_t left = block.frames - at;
      std::size_t frames = moving > 0 && moving < left ? moving : left;
      if (moving > 0) {
        wake();
        if (modes.is_exact && !Crossed) {
          frames = begin_exact(frames);
        }
        hold_all();
        play_bound<true>(at, frames);
        s.motion.is_stale = true;
        moving = moving_frames();
      } else if (s.sleep.silence > 0) {
        frames = frames < s.sleep.until_check || is_held() ? frames : s.sleep.until_check;
        play_steady(at, frames);
        put_modes_to_sleep(at + frames - 1, frames);
      } else {
        play_steady(at, frames);
      }
      at += frames;
    }
  }

  // Puts modes to sleep if no input and no link acts after frame `last`.
  void put_modes_to_sleep(std::size_t last, std::size_t frames) {
    s.sleep.until_check -=
        frames < s.sleep.until_check ? static_cast<std::uint32_t>(frames) : s.sleep.until_check;
    if (s.sleep.until_check > 0) {
      return;
    }
    find_pushes(last, 1);
    if (s.inputs.pushing == 0 && !is_held()) {
      check_sleep(s, places, places + outputs);
    }
    s.sleep.until_check = check_frames;
  }

  void play_steady(std::size_t first, std::size_t frames) {
    if (s.motion.is_stale) {
      mix(0, s.motion.k, s.motion.z);
      mix_forces();
      s.ends.has_bounds = !Crossed && measure_compliance(s, modes.modes, places);
      if (s.sleep.silence > 0) {
        measure_ringing(s);
      }
      s.motion.is_stale = false;
    }
    const bool is_quiet = has_quiet_inputs(first, frames);
    // Pushes that are one sample late are as constant as still inputs from the second sample on.
    const std::size_t end = first + frames;
    const std::size_t different = block.is_still && frames > 2 ? first + 2 : end;
    for (std::size_t n = is_quiet ? end - 1 : first; n < (is_quiet ? end : different); ++n) {
      fill_amplitudes(n);
    }
    if (is_quiet) {
      s.inputs.pushing = 0;
    } else {
      find_pushes(first, different - first);
      for (std::size_t n = different; s.inputs.pushing > 0 && n < end; ++n) {
        std::copy_n(s.inputs.amplitude + (n - 1) * pushes, pushes, s.inputs.amplitude + n * pushes);
      }
    }
    if (s.inputs.pushing > 0) {
      wake();
    }
    if (s.held.touched_frames > 0 || is_held() || !play_free(first, frames)) {
      play_touched(first, frames);
    }
  }

  // Returns whether all pushes are forces and all of them are 0.
  bool has_quiet_inputs(std::size_t first, std::size_t frames) const {
    const T* const value = block.value + first * inputs;
    return s.inputs.are_forces &&
           std::none_of(value, value + (block.is_still ? 1 : frames) * inputs,
                        [](T x) { return x != 0; });
  }

  // Computes the amplitude of each push in a sample.
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

  // Computes a part in which links act: first only those that can act if the links add to the norm
  // of the modes at most this norm and twice what they added in the last block. After a strike they
  // may add much more.
  void play_touched(std::size_t first, std::size_t frames) {
    const Motion motion = motion_in(first, frames);
    const T most = motion.norm + motion.soft_speed + motion.kicks + 2 * s.ends.kick_norm;
    const auto passed = static_cast<std::uint32_t>(frames);
    const bool is_surprised = s.held.surprised_frames > 0;
    s.held.surprised_frames -= passed < s.held.surprised_frames ? passed : s.held.surprised_frames;
    if (!is_surprised && play_some(first, frames, motion, most)) {
      return;
    }
    s.held.surprised_frames = is_surprised ? s.held.surprised_frames : frames_after_touch;
    if (!play_some(first, frames, motion, T(most_surprise) * most)) {
      hold_all();
      play_bound<false>(first, frames);
    }
  }
  // Computes only the links that can act if the links add at most this to the norm. Returns false,
  // with the state as before, if they add more.
  bool play_some(std::size_t first, std::size_t frames, const Motion& motion, T most) {
    if (s.ends.has_bounds && most > 0) {
      hold_some(first, frames, {.norm = motion.norm, .kicks = motion.kicks + most});
    } else {
      hold_all();
    }
    const bool is_whole = s.held.links == s.held.all_links;
    if (!is_whole) {
      save();
    }
    play_bound<false>(first, frames);
    if (is_whole || s.ends.kick_norm <= most) {
      return true;
    }
    restore();
    return false;
  }
  template <bool Moving>
  void play_bound(std::size_t first, std::size_t frames) {
    locate_places();
    choose_rows<Moving>();
    if (has_passive_links()) {
      measure_passive();
    }
    s.passive.shoves_later = !Moving && may_shove_later();
    std::fill_n(s.passive.shove, s.held.places, T(0));
    bool acts = false;
    constexpr bool moves_by_shares = Moving && !Crossed;
    if (moves_by_shares && modes.is_exact) {
      leap_shares(frames);
    }
    const bool is_lone = s.passive.shoves_later && s.passive.pulls && s.passive.active->alone == 1;
    if (is_lone) {
      acts = play_lone(first, frames);
    }
    for (std::size_t n = first; !is_lone && n < first + frames; ++n) {
      if constexpr (Moving) {
        if (moves_by_shares && modes.is_exact) {
          advance_exact();
        } else {
          advance(s.ramps);
          mix(0, s.motion.k, s.motion.z);
        }
        mix_forces();
        fill_amplitudes(n);
        if (has_passive_links()) {
          measure_passive();
        }
      }
      if (has_passive_links()) {
        remember_passive();
      }
      std::fill_n(s.ends.exerted, places + modes.ends.size(), T(0));
      std::fill_n(s.ends.force + places, modes.ends.size(), T(0));
      move_modes(n);
      move_places();
      move_ends(n);
      s.passive.is_pushed = has_passive_links() && solve_passive_links();
      acts |= compute_plain_links() || s.passive.is_pushed;
      read_outputs(n);
    }
    shove_now();
    s.ends.kick_norm = 0;
    for (std::size_t p = 0; p < places; ++p) {
      s.ends.kick_norm += norm_of_kicks(s.ends.kicked[p], s.shapes.place_norm[p]);
    }
    const auto passed = static_cast<std::uint32_t>(frames);
    s.held.touched_frames = acts                             ? frames_after_touch
                            : s.held.touched_frames > passed ? s.held.touched_frames - passed
                                                             : 0;
  }

  // One end of a link that acts alone.
  struct LoneEnd {
    std::uint32_t end;
    bool is_place;
    T x;
    T v;
    T give;                    // displacement by a unit force of the link
    T kick = 0;                // displacement of the modes along its row in the last sample
    T kicked = 0;              // sum of their magnitudes
    const T* speed = nullptr;  // by the sweep
  };
  LoneEnd lone_end(std::uint32_t end, std::uint32_t link) const {
    LoneEnd lone{.end = end, .is_place = end < places, .x = s.ends.x[end], .v = s.ends.v[end]};
    if (lone.is_place) {
      lone.give = inverse_mass() * s.passive.reply[end * s.passive.count + link];
      lone.speed = s.sweep.speed + s.held.row_of[end];
    }
    return lone;
  }
  void move_lone(LoneEnd& lone, std::size_t n) const {
    if (lone.is_place) {
      lone.v = *lone.speed;
      lone.x += lone.v;
    } else if (const ModalEnd& end = modes.ends[lone.end - places]; end.follows) {
      lone.x = block.value[n * inputs + end.input];
      lone.v = block.velocity[n * inputs + end.input];
    }
  }
  void push_lone(LoneEnd& lone, T force, T kick) const {
    if (lone.is_place) {
      lone.x -= lone.give * force;
      lone.v -= lone.give * force;
      lone.kick = kick;
      lone.kicked += absolute(kick);
      s.sweep.kick[s.held.row_of[lone.end]] = kick;
    }
  }
  void keep_lone(const LoneEnd& lone) const {
    s.ends.x[lone.end] = lone.x;
    s.ends.v[lone.end] = lone.v;
    if (lone.is_place) {
      s.ends.force[lone.end] = 0;
      s.ends.kicked[lone.end] += lone.kicked;
      s.passive.shove[s.held.row_of[lone.end]] = lone.kick;
    }
  }

  // Computes a part in which one passive link acts and nothing else pushes. Keeps the link in
  // registers: its force, which the next sample waits for, takes as long as the sweep otherwise.
  // Returns whether the link exerted a force.
  bool play_lone(std::size_t first, std::size_t frames) {
    const PassiveLink link = s.passive.active->links[0];
    const std::uint32_t i = link.ends.a;
    const T w = inverse_mass();
    const T slack = s.passive.slack[i];
    const ModalBody<T> body{s, w};
    const std::size_t kicked = s.held.places;
    const std::size_t heard = heard_along();
    LoneEnd a = lone_end(s.passive.links[i].ends.a, i);
    LoneEnd b = lone_end(s.passive.links[i].ends.b, i);
    laws::LinkState<T> state{.gamma = body.gamma(link.ends)};
    T yield = s.passive.yield[i];
    T yield_step = s.passive.yield_step[i];
    T force = 0;
    bool acts = false;
    std::fill_n(s.sweep.kick, kicked, T(0));
    for (std::size_t n = first; n < first + frames; ++n) {
      state.now = a.x - b.x + yield;
      state.speed = a.v - b.v + yield_step;
      sweep_sample<Crossed, true>(s, kicked, heard);
      move_lone(a, n);
      move_lone(b, n);
      state.free = a.x - b.x;
      state.fast = a.v - b.v - yield;
      force = may_act(link, state, body) ? RESSORT_ISA::force_of(link, state, body) : T(0);
      push_lone(a, force, -w * force);
      push_lone(b, force, w * force);
      yield_step = -yield - slack * force;
      yield = -slack * force;
      if (force != 0) {
        acts = true;
        if (s.sleep.awake < modes.modes) {
          wake();
          bundle<Crossed>(s, s.sweep.bundled);
        }
      }
      for (std::size_t o = 0; o < outputs; ++o) {
        const ModalOutput& output = modes.outputs[o];
        const T moved =
            o < heard ? s.sweep.heard[o] : read<Crossed>(s, s.shapes.outputs + o * s.shapes.row);
        block.outputs[n * outputs + o] =
            output.is_place ? static_cast<T>(output.place.rest) + moved -
                                  w * s.passive.reply[(places + o) * s.passive.count + i] * force
                            : position_of(output.end, n);
      }
    }
    move_ends(first + frames - 1);
    keep_lone(a);
    keep_lone(b);
    s.passive.yield[i] = yield;
    s.passive.yield_step[i] = yield_step;
    s.passive.pushed[i] = force;
    s.passive.is_pushed = force != 0;
    return acts;
  }

  void locate_places() {
    for (std::uint32_t p = 0; p < places; ++p) {
      s.ends.kicked[p] = 0;
      if (s.held.row_of[p] != nowhere) {
        locate_at_first(p);
      }
    }
  }

  // The state of crossed modes is one sample ahead at first. Until then a place stays where
  // set_state() has put it.
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

  // Chooses the rows of a sample's sweep: places, pushes that are not 0, and outputs.
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
  // Returns how many outputs a sweep computes. The others are summed one by one.
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

  // Computes the forces of plain links for the next sample. Returns whether any is not 0.
  bool compute_plain_links() {
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
            f *= compliance_share(law, d, *give / coefficient(modes.give_by));
          }
          acts |= f != 0;
          s.ends.force[a] -= f;
          s.ends.force[b] += f;
        }
      });
    }
    return acts;
  }

  void read_outputs(std::size_t n) {
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

  // Returns the force of links and inputs at a node, after all links have been computed.
  T force_of(const ModalForce& force, std::size_t number, std::size_t n) const {
    const T* const row = s.forces.rows + 2 * number * s.shapes.stride;
    T sum = s.forces.still[number] +
            (Crossed ? read<Crossed>(s, row)
                     : along(s, row, s.motion.q) + along(s, row + s.shapes.stride, s.motion.d));
    add_force_of_inputs(force, n, 1, &sum);
    for (const ModalForce::Weight& end : force.ends) {
      sum += static_cast<T>(end.weight) * (s.ends.force[end.of] + s.ends.exerted[end.of]);
    }
    return static_cast<T>(force.scale) * sum;
  }

  // Adds the part of such a force that the inputs exert, in some samples.
  void add_force_of_inputs(const ModalForce& force, std::size_t first, std::size_t frames,
                           T* sums) const {
    const T* const value = block.value + first * inputs;
    const T* const velocity = block.velocity + first * inputs;
    for (const ModalForce::Hand& hand : force.hands) {
      const T k = static_cast<T>(hand.weight) * coefficient(hand.stiffness);
      const T z = static_cast<T>(hand.weight) * coefficient(hand.damping);
      const T start = static_cast<T>(hand.start);
      for (std::size_t n = 0; n < frames; ++n) {
        const std::size_t at = n * inputs + hand.input;
        sums[n] += k * (value[at] - start) + z * velocity[at];
      }
    }
    for (const ModalForce::Weight& input : force.inputs) {
      const T weight = static_cast<T>(input.weight);
      for (std::size_t n = 0; n < frames; ++n) {
        sums[n] += weight * value[n * inputs + input.of];
      }
    }
  }

  // --- free motion ----------------------------------------------------------------------------

  // Computes the part a few samples at a time. Returns false, with the state as before, if a link
  // acts in it.
  bool play_free(std::size_t first, std::size_t frames) {
    std::size_t rows = hear_outputs();
    const std::size_t heard = rows;
    if (s.inputs.pushing > 2 || (!modes.holds.empty() && !find_suspects(first, frames, rows)) ||
        rows > most_heard) {
      return false;
    }
    remember_damped();
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

  // Chooses the rows of the outputs: one for a position, and one or two for a force. Returns their
  // number.
  std::size_t hear_outputs() {
    std::size_t rows = 0;
    std::size_t force = 0;
    for (std::size_t o = 0; o < outputs; ++o) {
      const ModalOutput& output = modes.outputs[o];
      if (output.is_place) {
        s.sweep.rows[rows++] = s.shapes.outputs + o * s.shapes.row;
      } else if (output.is_force) {
        const T* const row = s.forces.rows + 2 * force * s.shapes.stride;
        s.sweep.rows[rows++] = row;
        if (has_damped_row(force++)) {
          s.sweep.rows[rows++] = row + s.shapes.stride;
        }
      }
    }
    return rows;
  }
  // Returns whether dampers act on this output, which is a force. Crossed modes have one row.
  bool has_damped_row(std::size_t force) const { return !Crossed && s.forces.damped[force] != 0; }

  // Stores what the dampers' row reads before the part: d is the change of q per sample.
  void remember_damped() {
    for (std::size_t force = 0; force < s.forces.count; ++force) {
      if (has_damped_row(force)) {
        s.forces.before[force] =
            along(s, s.forces.rows + (2 * force + 1) * s.shapes.stride, s.motion.q);
      }
    }
  }

  // Adds the places to the rows whose links may act. Returns false if a link acts in any case.
  bool find_suspects(std::size_t first, std::size_t frames, std::size_t& rows) {
    for (std::size_t p = 0; p < places; ++p) {
      s.held.row_of[p] = nowhere;
    }
    const Motion motion = motion_in(first, frames);
    for (const ModalHold& hold : modes.holds) {
      const LinkRun& run = program.link_runs[hold.run];
      for (std::size_t i = 0; i < hold.a.size(); ++i) {
        if (!may_act_within(run, hold.a[i], hold.b[i], first, frames, motion)) {
          continue;
        }
        if (!can_detach(run.law)) {
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

  // Returns whether the free motion met no link.
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
  // Computes as many samples at a time as there are registers for the rows.
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
    std::size_t force = 0;
    const T* seen = s.sweep.seen;
    for (std::size_t o = 0; o < outputs; ++o) {
      const ModalOutput& output = modes.outputs[o];
      T* out = block.outputs + first * outputs + o;
      if (output.is_force) {
        seen = write_force(output.force, force++, seen, out, first, frames);
        continue;
      }
      if (output.is_place) {
        const T rest = static_cast<T>(output.place.rest);
        for (std::size_t n = 0; n < frames; ++n) {
          out[n * outputs] = rest + seen[n];
        }
        seen += max_block_frames;
        continue;
      }
      for (std::size_t n = 0; n < frames; ++n) {
        out[n * outputs] = position_of(output.end, first + n);
      }
    }
  }
  // Writes a force while no link acts. Returns where the next output's row was seen.
  const T* write_force(const ModalForce& force, std::size_t number, const T* seen, T* out,
                       std::size_t first, std::size_t frames) {
    const bool has_damped = has_damped_row(number);
    const T* const damped = seen + max_block_frames;
    const T still = s.forces.still[number];
    T sums[max_block_frames];
    for (std::size_t n = 0; n < frames; ++n) {
      sums[n] = still + seen[n];
    }
    if (has_damped) {
      sums[0] += damped[0] - s.forces.before[number];
      for (std::size_t n = 1; n < frames; ++n) {
        sums[n] += damped[n] - damped[n - 1];
      }
    }
    add_force_of_inputs(force, first, frames, sums);
    const T scale = static_cast<T>(force.scale);
    for (std::size_t n = 0; n < frames; ++n) {
      out[n * outputs] = scale * sums[n];
    }
    return seen + (has_damped ? 2 : 1) * max_block_frames;
  }

  // --- links ------------------------------------------------------------------------------------

  void wake() {
    if (s.sleep.awake < modes.modes) {
      stay_awake(s, modes.modes);
      s.sleep.until_check = check_frames;
    }
  }
  // Returns whether a link exerted a force in the last sample.
  bool is_held() const {
    for (std::size_t p = 0; p < places; ++p) {
      if (s.ends.force[p] != 0) {
        return true;
      }
    }
    return s.passive.is_pushed;
  }

  // --- positions and their bounds -------------------------------------------------------------

  T position_of(std::uint32_t end, std::size_t n) const {
    const ModalEnd& other = modes.ends[end - places];
    return other.follows ? block.value[n * inputs + other.input]
                         : static_cast<T>(program.position[other.node]);
  }

  // Moves the ends that follow a position input.
  void move_ends(std::size_t n) {
    for (std::size_t i = 0; i < modes.ends.size(); ++i) {
      if (modes.ends[i].follows) {
        s.ends.x[places + i] = block.value[n * inputs + modes.ends[i].input];
        s.ends.v[places + i] = block.velocity[n * inputs + modes.ends[i].input];
      }
    }
  }

  // Returns these bounds without the forces of links.
  Motion motion_in(std::size_t first, std::size_t frames) {
    Motion motion{
        .norm = std::sqrt(ringing_energy(s)), .soft_speed = measure_soft_speeds(s), .kicks = 0};
    for (std::size_t r = 0; r < s.inputs.pushing; ++r) {
      const std::size_t j = s.inputs.push_of[r];
      T sum = 0;
      for (std::size_t n = first; n < first + frames; ++n) {
        sum += absolute(s.inputs.amplitude[n * pushes + j]);
      }
      motion.kicks += norm_of_kicks(sum, s.shapes.push_norm[j]);
    }
    return motion;
  }

  // Returns the range of positions of an end in this part and in the two samples before it.
  Range<T> range_of(std::uint32_t end, std::size_t first, std::size_t frames,
                    const Motion& motion) const {
    if (end < places) {
      const Range<T> range = displacement_of(s, end, motion.norm, motion.kicks);
      const T rest = static_cast<T>(modes.places[end].rest);
      return {rest + range.low, rest + range.high};
    }
    Range<T> range{s.ends.x[end], s.ends.x[end]};
    range.take(s.ends.x[end] - s.ends.v[end]);
    for (std::size_t n = first; n < first + frames && modes.ends[end - places].follows; ++n) {
      range.take(position_of(end, n));
    }
    return range;
  }
  bool may_act_within(const LinkRun& run, std::uint32_t a, std::uint32_t b, std::size_t first,
                      std::size_t frames, const Motion& motion) const {
    if (!s.ends.has_bounds) {
      return true;
    }
    const Range<T> at = range_of(a, first, frames, motion);
    const Range<T> to = range_of(b, first, frames, motion);
    return may_act<T>(run, s.ramps.value, {at.low - to.high, at.high - to.low});
  }

  // --- choice of links ------------------------------------------------------------------------

  // Saves and restores the state that a part may change, except for its counters.
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
    choose_links([](const LinkRun&, std::uint32_t, std::uint32_t) { return true; });
  }
  void hold_some(std::size_t first, std::size_t frames, const Motion& motion) {
    choose_links([&](const LinkRun& run, std::uint32_t a, std::uint32_t b) {
      return (a < places && s.ends.force[a] != 0) || (b < places && s.ends.force[b] != 0) ||
             may_act_within(run, a, b, first, frames, motion);
    });
  }
  // Chooses the links to compute and the places that they need.
  template <class Condition>
  void choose_links(Condition&& condition) {
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
    // A single passive link is solved alone, several together.
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

  // --- passive links ----------------------------------------------------------------------------

  bool has_passive_links() const { return !s.passive.active->links.empty(); }

  // Returns whether the displacements by passive links may be added in the next sample's sweep.
  // This requires that the sweep has no other kicks and that nothing reads the modes before it.
  bool may_shove_later() const {
    const bool is_all = std::all_of(s.held.count_of, s.held.count_of + modes.holds.size(),
                                    [](std::uint32_t plain) { return plain == 0; });
    return has_passive_links() && is_all && s.inputs.pushing == 0 && s.forces.count == 0 &&
           s.held.places <= most_kicked;
  }
  // Adds displacements that were deferred.
  void shove_now() {
    if (std::exchange(s.passive.shoves_later, false)) {
      shove_rows<Crossed>(s);
    }
  }

  // Updates the matrices at the start of a part, or in each sample with changing coefficients.
  void measure_passive() {
    if (s.passive.is_reply_stale) {
      measure_replies<Crossed>(s, places, outputs);
      s.passive.is_reply_stale = false;
    }
    s.passive.is_straight_stale = true;
    for (std::size_t i = 0; i < s.passive.count; ++i) {
      s.passive.slack[i] =
          s.passive.give[i] > 0 ? s.passive.give[i] / coefficient(modes.give_by) : T(0);
    }
  }

  void remember_passive() {
    remember(*s.passive.active, s.passive.memory, ModalBody<T>{s, inverse_mass()});
  }

  // Solves the passive links after everything else has moved. Moves places, outputs and modes by
  // their forces. Returns whether any force is not 0.
  bool solve_passive_links() {
    const T w = inverse_mass();
    T* row = s.passive.memory;
    for (const PassiveLink& link : s.passive.active->links) {
      const std::uint32_t i = link.ends.a;
      const auto [a, b] = s.passive.links[i].ends;
      s.passive.opening[i] = s.ends.x[a] - s.ends.x[b];
      s.passive.rush[i] = s.ends.v[a] - s.ends.v[b] - s.passive.yield[i];
      row[2] = s.passive.pushed[i];  // initial value of the solver
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

  // Returns the displacement of a listener by all passive links.
  T moved(std::size_t listener) const {
    T sum = 0;
    for (const PassiveLink& link : s.passive.active->links) {
      sum +=
          s.passive.reply[listener * s.passive.count + link.ends.a] * s.passive.pushed[link.ends.a];
    }
    return inverse_mass() * sum;
  }
  void shove(std::uint32_t end, T force) {
    s.ends.exerted[end] += force;
    if (end < places) {
      const T kick = inverse_mass() * force;
      s.passive.shove[s.held.row_of[end]] += kick;
      s.ends.kicked[end] += absolute(kick);
    }
  }
  void move_by_shoves() {
    if (s.sleep.awake < modes.modes) {
      wake();
      if (s.held.places + s.inputs.pushing <= most_kicked) {
        bundle<Crossed>(s, s.sweep.bundled);
      }
    }
    if (!s.passive.shoves_later) {
      shove_rows<Crossed>(s);
    }
  }

  // --- coefficients -----------------------------------------------------------------------------

  T coefficient(std::uint32_t c) const { return s.ramps.value[c]; }
  T inverse_mass() const {
    return modes.inverse_mass == Modes::own_mass ? T(1) : coefficient(modes.inverse_mass);
  }

  // Returns the number of samples, from now on, in which the coefficients change.
  std::size_t moving_frames() {
    s.motion.may_move |= s.ramps.frames > 0;
    if (s.ramps.frames > 0 || !s.motion.may_move) {
      return s.ramps.frames;
    }
    const T* used = s.motion.used;
    bool is_same = true;
    for (const ModalShare& share : modes.stiffness) {
      is_same &= *used++ == coefficient(share.coefficient);
    }
    for (const ModalShare& share : modes.damping) {
      is_same &= *used++ == coefficient(share.coefficient);
    }
    s.motion.may_move = !is_same || *used != inverse_mass();
    return s.motion.may_move ? 1 : 0;
  }

  // Returns a coefficient some samples ahead.
  T coefficient(std::uint32_t c, std::size_t ahead) const {
    if (ahead == 0) {
      return s.ramps.value[c];
    }
    return ahead < s.ramps.frames ? s.ramps.value[c] + static_cast<T>(ahead) * s.ramps.increment[c]
                                  : s.ramps.target[c];
  }

  // Computes lK and lZ some samples ahead.
  void mix(std::size_t ahead, T* k, T* z) {
    const T w =
        modes.inverse_mass == Modes::own_mass ? T(1) : coefficient(modes.inverse_mass, ahead);
    if constexpr (Crossed) {
      // The initial state of crossed modes is that of the first sample. Only pushes move the modes
      // in this sample.
      s.motion.is_first = *s.motion.used == 0;
      const T here = s.motion.is_first ? T(0) : T(1);
      for (std::size_t i = 0; i < all_packs(s); ++i) {
        packs(k)[i] = here * packs(s.shapes.pole)[i];
        packs(z)[i] = here * packs(s.shapes.pole + s.shapes.stride)[i];
      }
      *s.motion.used = w;
      return;
    }
    T* used = mix(modes.stiffness, s.shapes.stiffness, ahead, w, k, s.motion.used);
    used = mix(modes.damping, s.shapes.damping, ahead, w, z, used);
    *used = w;
    if (modes.is_exact) {
      make_exact(s, modes.pushes.size() + modes.places.size() + modes.outputs.size(), k, z);
    }
  }
  T* mix(const std::vector<ModalShare>& shares, const T* factors, std::size_t ahead, T w, T* out,
         T* used) {
    for (std::size_t i = 0; i < all_packs(s); ++i) {
      packs(out)[i] = ModePack<T>{};
    }
    for (std::size_t j = 0; j < shares.size(); ++j, ++used) {
      const std::uint32_t c = shares[j].coefficient;
      const T value = w * (!shares[j].is_late ? coefficient(c, ahead)
                           : ahead > 1        ? coefficient(c, ahead - 1)
                                              : *used);
      *used = coefficient(c, ahead);
      constexpr std::size_t lanes = mode_lanes<T>;
      const std::size_t first = shares[j].first / lanes;
      const std::size_t end = (shares[j].first + shares[j].factor.size() + lanes - 1) / lanes;
      for (std::size_t i = first; i < end; ++i, factors += lanes) {
        packs(out)[i] += value * *packs(factors);
      }
    }
    return used;
  }

  // Computes the rows of outputs that are forces, from the current coefficients.
  void mix_forces() {
    std::size_t force = 0;
    for (const ModalOutput& output : modes.outputs) {
      if (!output.is_force) {
        continue;
      }
      T* const rows = s.forces.rows + 2 * force * s.shapes.stride;
      std::fill_n(rows, 2 * s.shapes.stride, T(0));
      T still = 0;
      for (const ModalForce::Part& part : output.force.parts) {
        const T c = coefficient(part.coefficient);
        // Crossed modes have one row of two parts; dampers use the shape of velocities.
        for (std::size_t i = 0; i < part.shape.size(); ++i) {
          const std::size_t mode = i % modes.modes;
          const bool is_second = Crossed ? i >= modes.modes : part.is_damping;
          const T root = modes.is_exact && !Crossed ? s.motion.root[mode] : T(1);
          rows[(is_second ? s.shapes.stride : 0) + mode] +=
              c * root * static_cast<T>(part.shape[i]);
        }
        still += c * static_cast<T>(part.constant);
      }
      const T* const damped = rows + s.shapes.stride;
      s.forces.damped[force] =
          std::any_of(damped, damped + s.shapes.stride, [](T x) { return x != 0; }) ? T(1) : T(0);
      s.forces.still[force++] = still;
    }
  }

  // Interpolates the exact coefficients linearly over `frames` samples. Returns the number of
  // samples, which is 1 just after set_state(), as links exert no force in the first sample.
  std::size_t begin_exact(std::size_t frames) {
    frames = s.motion.fresh_frames < 2 ? 1 : frames;
    s.motion.fresh_frames += s.motion.fresh_frames < 2;
    mix(frames, s.motion.k_step, s.motion.z_step);
    const T share = T(1) / static_cast<T>(frames);
    for (std::size_t i = 0; i < all_packs(s); ++i) {
      packs(s.motion.k_step)[i] = share * (packs(s.motion.k_step)[i] - packs(s.motion.k)[i]);
      packs(s.motion.z_step)[i] = share * (packs(s.motion.z_step)[i] - packs(s.motion.z)[i]);
    }
    return frames;
  }
  // Moves the coefficients that only give shares of k and z, to the end of a part: advance_exact()
  // moves k and z instead.
  void leap_shares(std::size_t frames) {
    for (std::size_t i = 0; i < s.ramps.count; ++i) {
      const std::uint32_t c = s.ramps.ramping[i];
      bool is_felt = false;
      for (const std::uint32_t felt : modes.felt) {
        is_felt |= felt == c;
      }
      s.ramps.value[c] = is_felt ? s.ramps.value[c] : coefficient(c, frames);
    }
  }
  void advance_exact() {
    if (s.ramps.frames > 0) {
      const bool arrives = --s.ramps.frames == 0;
      for (const std::uint32_t c : modes.felt) {
        s.ramps.value[c] = arrives ? s.ramps.target[c] : s.ramps.value[c] + s.ramps.increment[c];
      }
    }
    for (std::size_t i = 0; i < all_packs(s); ++i) {
      packs(s.motion.k)[i] += packs(s.motion.k_step)[i];
      packs(s.motion.z)[i] += packs(s.motion.z_step)[i];
    }
  }
};

template <class T, bool Crossed>
void step(const Program& program, const Modes& modes, ModalState<T>& state, const Block<T>& block) {
  ModalPlayer<T, Crossed>{modes, state, program, block}.play();
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
