// The loops of the direct form. A part of direct_step.cpp, which is compiled once for each
// instruction set.
#pragma once

#include "core/kernels/direct/direct_places.h"
#include "core/kernels/passive/passive.h"
#include "core/kernels/waveguides/rail_loops.h"
#include "core/laws/laws.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

// DirectState with packs in place of numbers.
template <class T, std::size_t Bytes>
struct View {
  using V = Pack<T, Bytes>;
  static constexpr std::size_t lanes = Bytes / sizeof(T);

  explicit View(DirectState<T>& state_in)
      : state(state_in),
        x(reinterpret_cast<V*>(state.x)),
        v(reinterpret_cast<V*>(state.v)),
        force(reinterpret_cast<V*>(state.force)),
        coefficient(reinterpret_cast<const V*>(state.ramps.value)) {}

  DirectState<T>& state;
  // Returns the distance between two nodes.
  V between(std::size_t a, std::size_t b) const { return x[a] - x[b]; }
  void move(std::size_t node) { shift(node, v[node]); }
  void shift(std::size_t node, V way) { x[node] += way; }
  void move_to(std::size_t node, V position) {
    v[node] = position - x[node];
    x[node] = position;
  }

  V* x;
  V* v;
  V* force;
  const V* coefficient;
};

// Moves the masses of a run by one step of symplectic Euler (semi-implicit Euler; Störmer-Verlet or
// leapfrog in the velocity half a sample back):
//   v[n+1] = v[n] + (F[n] - pull(x[n], v[n])) / M,   x[n+1] = x[n] + v[n+1]
// F is the sum of link and input forces. `pull` is the mass's own spring, damper and gravity. The
// new velocity moves the position; with the old one the scheme would gain energy at any stiffness.
template <class S, class Pull>
void move_masses(const MassRun& run, S& s, Pull&& pull) {
  using V = typename S::V;
  const V inverse_mass = s.coefficient[run.inverse_mass];
  for (std::uint32_t i = run.first; i < run.first + run.count; ++i) {
    s.v[i] += (s.force[i] - pull(s.x[i], s.v[i])) * inverse_mass;
    s.move(i);
    s.force[i] = V{};
  }
}

// Clears the forces on nodes without inertia, which no force moves.
template <class S>
void rest_others(const Program& program, S& s) {
  for (std::size_t i = program.moving; i < s.state.nodes; ++i) {
    s.force[i] = typename S::V{};
  }
}

template <class S>
void step_masses(const Program& program, S& s) {
  using V = typename S::V;
  for (const MassRun& run : program.mass_runs) {
    if (run.is_junction) {
      continue;  // Waves move these nodes.
    }
    const V k = s.coefficient[run.stiffness];
    const V z = s.coefficient[run.damping];
    const V g = run.has_gravity ? s.coefficient[run.gravity] : V{};
    if (run.is_oscillator) {
      move_masses(run, s, [=](V x, V v) { return k * x + z * v + g; });
    } else if (run.has_gravity) {
      move_masses(run, s, [=](V, V) { return g; });
    } else {
      move_masses(run, s, [](V, V) { return V{}; });
    }
  }
  rest_others(program, s);
}

// Adds the forces of links: -f at the first end, f at the second (Newton's third law). The loop and
// its callers are inlined, because a law often has so few links that a call would cost more.
template <class S, class ForceOf>
[[gnu::always_inline]] inline void exert(const Ends* ends, std::uint32_t count, S& s,
                                         ForceOf&& force_of) {
  using V = typename S::V;
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto [a, b] = ends[i];
    const V f = force_of(a, b);
    s.force[a] -= f;
    s.force[b] += f;
  }
}

// Adds the forces of some links of a run, computed explicitly from positions and velocities.
template <class S>
[[gnu::always_inline]] inline void exert_law(const Program& program, const LinkRun& run,
                                             std::uint32_t first, std::uint32_t count, S& s) {
  using V = typename S::V;
  const auto c = [&](std::size_t i) { return s.coefficient[run.coefficients[i]]; };
  with_law_type(
      run.law, [&]<class Type>(Type) __attribute__((always_inline)) {
        const auto law = law_of<Type, V>(c);
        const auto force = [&](std::uint32_t a, std::uint32_t b) __attribute__((always_inline)) {
          return law.force(s.between(a, b), s.v[a] - s.v[b]);
        };
        exert(program.ends.data() + first, count, s, force);
      });
}

template <class S>
[[gnu::always_inline]] inline void step_links(const Program& program, S& s) {
  for (const LinkRun& run : program.link_runs) {
    if (run.scheme == Scheme::plain) {
      exert_law(program, run, run.first, run.count, s);
    }
  }
}

// The interface through which the passive solver (passive.h) reads and moves nodes and points.
template <class S>
struct Passive {
  using V = typename S::V;
  using T = Scalar<V>;

  CoefficientView<V> coefficients() const { return {s.coefficient}; }
  V awake() const { return *reinterpret_cast<const V*>(s.state.awake); }
  V distance_now(Ends ends) const { return s.between(ends.a, ends.b); }
  V speed_now(Ends ends) const { return s.v[ends.a] - s.v[ends.b]; }
  V distance(Ends ends) const {
    return is_place(program, ends.a) || is_place(program, ends.b)
               ? position(ends.a) - position(ends.b)
               : s.between(ends.a, ends.b);
  }
  V speed(Ends ends) const { return speed(ends.a) - speed(ends.b); }
  V gamma(Ends ends) const {
    const auto [a, b] = ends;
    const bool may_meet = a == b || is_place(program, a) || is_place(program, b);
    return give(a, a) + give(b, b) - (may_meet ? 2 * give(a, b) : V{});
  }
  void push(Ends ends, V force) {
    if (any_of(force != V{})) {
      push_node(ends.a, -force);
      push_node(ends.b, force);
    }
  }
  void shift(std::uint32_t node, V way) {
    s.shift(node, way);
    s.v[node] += way;
  }
  void add_reaction(std::uint32_t node, V force) {
    if (s.state.felt != nullptr) {
      reinterpret_cast<V*>(s.state.felt)[node] += force;
    }
  }
  // Returns the displacement of node `at` by a unit force on node `from` in one sample.
  V give(std::uint32_t from, std::uint32_t at) const {
    if (!is_place(program, from) && !is_place(program, at)) {
      return from == at ? inverse_mass(at) : V{};
    }
    return give_of_places(from, at);
  }
  void push_node(std::uint32_t node, V force) {
    if (!is_place(program, node)) {
      if (node < program.moving) {
        shift(node, inverse_mass(node) * force);
      }
      return add_reaction(node, force);
    }
    push_place(node, force);
  }

 private:
  [[gnu::noinline]] V give_of_places(std::uint32_t from, std::uint32_t at) const {
    // A node without inertia does not move. A place on a waveguide is not on a macro.
    for (const std::uint32_t node : {from, at}) {
      if (!is_place(program, node) && (node >= program.moving || is_junction(program, node))) {
        return V{};
      }
    }
    return shared(program, s, from, at, [this](std::uint32_t node) { return inverse_mass(node); });
  }
  [[gnu::noinline]] void push_place(std::uint32_t node, V force) {
    share_out(program, s, node - program.taps[0].node, force, [this](std::uint32_t at, V part) {
      const V way = inverse_mass(at) * part;
      s.x[at] += way;
      s.v[at] += way;
      add_reaction(at, part);
    });
  }

  V position(std::uint32_t node) const {
    return is_place(program, node) ? seen_at(program, s, node - program.taps[0].node, s.x)
                                   : s.x[node];
  }

  V speed(std::uint32_t node) const {
    return is_place(program, node) ? position(node) - s.x[node] : s.v[node];
  }

  V inverse_mass(std::uint32_t node) const {
    return node < program.moving ? s.coefficient[s.state.inverse_mass[node]] : V{};
  }

 public:
  const Program& program;
  S& s;
};

template <class S>
[[gnu::noinline]] void remember_links(const Program& program, S& s) {
  using V = typename S::V;
  remember(s.state.passive, reinterpret_cast<V*>(s.state.memory), Passive<S>{program, s});
}

template <class S>
[[gnu::noinline]] void correct_links(const Program& program, S& s) {
  using V = typename S::V;
  if (s.state.felt != nullptr) {
    for (std::size_t i = 0; i < s.state.nodes * S::lanes; ++i) {
      s.state.felt[i] = 0;
    }
  }
  Passive<S> body{program, s};
  correct(s.state.passive, reinterpret_cast<V*>(s.state.memory),
          reinterpret_cast<V*>(s.state.solver), body);
  *reinterpret_cast<V*>(s.state.awake) = V{} + 1;
}

// Adds all link forces for the next sample.
template <class S>
[[gnu::always_inline]] inline void pull(const Program& program, S& s) {
  step_links(program, s);
  spread_taps(program, s);
}

template <class S>
typename S::V read_output(const Program& program, const S& s, const typename S::V* value,
                          const OutputSlot& output) {
  if (!output.is_force) {
    // Even and odd samples at a place on a waveguide are independent. The output is their mean.
    return is_junction(program, output.node) ? s.x[output.node] - s.v[output.node] / 2
                                             : s.x[output.node];
  }
  auto force = force_at(program, s, output.node);
  for (std::size_t i = 0; i < program.inputs.size(); ++i) {
    if (program.inputs[i].is_force) {
      force += shared(program, s, program.inputs[i].node, output.node,
                      [](std::uint32_t) { return typename S::V{} + 1; }) *
               value[i];
    }
  }
  return force / static_cast<Scalar<typename S::V>>(program.rate_ratio * program.rate_ratio);
}

// Computes a block. In each sample:
//   1. ramps and audio parameters change the coefficients
//   2. input forces are added; forces on points are distributed to the nodes around them
//   3. masses move by the forces of the sample before and the input forces (symplectic Euler)
//   4. waveguides and position inputs move
//   5. passive links, which are implicit, correct the new positions
//   6. plain links compute their forces at the new positions, for the next sample
//   7. outputs are read
template <class S, class T>
void step(const Program& program, DirectState<T>& state, const Block<T>& block) {
  using V = typename S::V;
  S s(state);
  const auto* value = reinterpret_cast<const V*>(block.value);
  const auto* velocity = reinterpret_cast<const V*>(block.velocity);
  const auto* audio = reinterpret_cast<const V*>(block.audio);
  auto* coefficient = reinterpret_cast<V*>(state.ramps.value);
  auto* outputs = reinterpret_cast<V*>(block.outputs);
  const std::size_t inputs = program.inputs.size();
  // Features that the Program has.
  const bool has_passive = !state.passive.links.empty();
  const bool has_taps = !program.taps.empty();
  const bool has_rails = state.rails != nullptr;
  const bool has_masses = state.nodes > program.junctions.size();
  const bool has_plain =
      std::any_of(program.link_runs.begin(), program.link_runs.end(),
                  [](const LinkRun& run) { return run.scheme == Scheme::plain; });
  const bool has_positions = std::any_of(program.inputs.begin(), program.inputs.end(),
                                         [](const InputSlot& input) { return !input.is_force; });
  for (std::size_t frame = 0; frame < block.frames; ++frame) {
    advance(state.ramps);
    for (const std::uint32_t c : program.audio_coefficients) {
      coefficient[c] = *audio++;
    }
    if (has_passive) {
      remember_links(program, s);
    }
    for (std::size_t i = 0; i < inputs; ++i) {
      if (program.inputs[i].is_force) {
        s.force[program.inputs[i].node] += value[i];
      }
    }
    if (has_taps) {
      place_taps(program, s);
      spread_taps(program, s);
    }
    if (has_masses) {
      step_masses(program, s);
    }
    if (has_rails) {
      if (state.rails->run == 0) {
        RailLoops<V, T>::read_run(*state.rails, block.frames - frame);
      }
      RailLoops<V, T>::move_places(program, *state.rails, s);
    }
    for (std::size_t i = 0; has_positions && i < inputs; ++i) {
      if (!program.inputs[i].is_force) {
        s.x[program.inputs[i].node] = value[i];
        s.v[program.inputs[i].node] = velocity[i];
      }
    }
    if (has_passive) {
      correct_links(program, s);
    }
    if (has_rails) {
      RailLoops<V, T>::advance_waves(program, *state.rails, s);
    }
    if (has_taps) {
      move_taps(program, s);
    }
    if (has_plain || has_taps) {
      pull(program, s);
    }
    for (const OutputSlot& output : program.outputs) {
      *outputs++ = read_output(program, s, value, output);
    }
    value += inputs;
    velocity += inputs;
  }
}

template <class T>
DirectLoops<T> loops_for(std::size_t bytes) {
  return with_bytes<vector_bytes(Isa::RESSORT_ISA)>(
      bytes, []<std::size_t pack>() { return DirectLoops<T>{step<View<T, pack>, T>}; });
}

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA
