// The published scheme, stepped as it is written. In (position, velocity) form it is the same
// maths as 2x[n] - x[n-1], and keeps 10 to 80 dB more in single precision: the velocity is a small
// number of its own instead of the difference of two large ones.
#include <cmath>

#include "core/engine/laws.h"
#include "core/engine/program.h"

namespace ressort {
namespace {

constexpr double reference_rate_hz = 44100.0;

template <class T>
void ramp_coefficients(State<T>& state) {
  if (--state.ramp_frames > 0) {
    for (const std::uint32_t c : state.ramping) {
      state.coefficient[c] += state.increment[c];
    }
    return;
  }
  for (const std::uint32_t c : state.ramping) {
    state.coefficient[c] = state.target[c];
    state.is_ramping[c] = false;
  }
  state.ramping.clear();
}

// The loop over one run's masses; `pull` is what acts on one besides its links.
template <class T, class Pull>
void move_masses(const MassRun& run, State<T>& state, Pull&& pull) {
  using V = Lanes<T>;
  const V inverse_mass = state.coefficient[run.inverse_mass];
  V* const x = state.x.data();
  V* const v = state.v.data();
  V* const force = state.force.data();
  for (std::uint32_t i = run.first; i < run.first + run.count; ++i) {
    v[i] += (force[i] - pull(x[i], v[i])) * inverse_mass;
    x[i] += v[i];
    force[i] = V{};
  }
}

template <class T>
void step_masses(const Program& program, State<T>& state) {
  using V = Lanes<T>;
  for (const MassRun& run : program.mass_runs) {
    const V k = state.coefficient[run.stiffness];
    const V z = state.coefficient[run.damping];
    const V g = run.has_gravity ? state.coefficient[run.gravity] : V{};
    if (run.is_oscillator) {
      move_masses(run, state, [=](V x, V v) { return k * x + z * v + g; });
    } else if (run.has_gravity) {
      move_masses(run, state, [=](V, V) { return g; });
    } else {
      move_masses(run, state, [](V, V) { return V{}; });
    }
  }
  for (std::size_t i = program.moving; i < state.force.size(); ++i) {
    state.force[i] = V{};
  }
}

// The loop over one run's links, for any law of (d, v).
template <class T, class ForceLaw>
void add_forces(const Program& program, const LinkRun& run, State<T>& state, ForceLaw&& law) {
  using V = Lanes<T>;
  const V* const x = state.x.data();
  const V* const v = state.v.data();
  V* const force = state.force.data();
  const Ends* const ends = program.ends.data() + run.first;
  for (std::uint32_t i = 0; i < run.count; ++i) {
    const auto [a, b] = ends[i];
    const V f = law(x[a] - x[b], v[a] - v[b]);
    force[a] -= f;
    force[b] += f;
  }
}

template <class T>
void step_links(const Program& program, State<T>& state) {
  using V = Lanes<T>;
  for (const LinkRun& run : program.link_runs) {
    const V c0 = state.coefficient[run.coefficients[0]];
    const V c1 = state.coefficient[run.coefficients[1]];
    const V c2 = state.coefficient[run.coefficients[2]];
    const V c3 = state.coefficient[run.coefficients[3]];
    const V c4 = state.coefficient[run.coefficients[4]];
    switch (run.law) {
      case Law::spring:
        add_forces(program, run, state, [=](V d, V v) { return spring_force(d, v, c0, c1); });
        break;
      case Law::quadratic_spring:
        add_forces(program, run, state,
                   [=](V d, V v) { return quadratic_spring_force(d, v, c0, c1, c2); });
        break;
      case Law::cubic_spring:
        add_forces(program, run, state,
                   [=](V d, V v) { return cubic_spring_force(d, v, c0, c1, c2); });
        break;
      case Law::clipped_spring:
        add_forces(program, run, state,
                   [=](V d, V v) { return clipped_spring_force(d, v, c0, c1, c2, c3); });
        break;
      case Law::clipped_contact:
        add_forces(program, run, state,
                   [=](V d, V v) { return clipped_contact_force(d, v, c0, c1, c2, c3, c4); });
        break;
      case Law::pluck:
        add_forces(program, run, state, [=](V d, V v) { return pluck_force(d, v, c0, c1, c2); });
        break;
      case Law::bow:
        add_forces(program, run, state, [=](V, V v) { return bow_force(v, c0, c1); });
        break;
      case Law::smooth_bow:
        add_forces(program, run, state, [=](V, V v) { return smooth_bow_force(v, c0, c1); });
        break;
      case Law::contact:
        add_forces(program, run, state, [=](V d, V v) { return contact_force(d, v, c0, c1, c2); });
        break;
    }
  }
}

// Calls `use(node, weight)` for the up to four nodes around a tap's place in one lane.
template <class T, class Use>
void around(const Program& program, const TapSlot& tap, const TapPlace<T>& place, std::size_t lane,
            Use&& use) {
  const T alpha = place.alpha[lane];
  const T beta = place.beta[lane];
  const std::uint32_t* const row =
      program.tap_nodes.data() + tap.first + place.row[lane] * tap.width + place.column[lane];
  use(row[0], (1 - alpha) * (1 - beta));
  if (beta > 0) {
    use(row[1], (1 - alpha) * beta);
  }
  if (alpha > 0) {
    use(row[tap.width], alpha * (1 - beta));
    if (beta > 0) {
      use(row[tap.width + 1], alpha * beta);
    }
  }
}

// w_i = max(0, 1 - |p - i|) along each side, p being the coordinate in nodes.
template <class T>
void place_taps(const Program& program, State<T>& state) {
  const auto locate = [](T coordinate, std::uint32_t nodes, std::uint32_t& below, T& beyond) {
    // Not std::clamp: what is no number becomes 0.
    const T within = coordinate > 0 ? (coordinate < 1 ? coordinate : T(1)) : T(0);
    const T p = within * static_cast<T>(nodes - 1);
    below = static_cast<std::uint32_t>(p);
    beyond = p - static_cast<T>(below);
  };
  for (std::size_t i = 0; i < program.taps.size(); ++i) {
    const TapSlot& tap = program.taps[i];
    TapPlace<T>& place = state.taps[i];
    for (std::size_t lane = 0; lane < lane_count<T>; ++lane) {
      T beyond = 0;
      locate(state.coefficient[tap.u][lane], tap.length, place.row[lane], beyond);
      place.alpha[lane] = beyond;
      locate(state.coefficient[tap.v][lane], tap.width, place.column[lane], beyond);
      place.beta[lane] = beyond;
    }
  }
}

// A point moves with the nodes around it, and along them when its coordinate changes.
template <class T>
void move_taps(const Program& program, State<T>& state) {
  for (std::size_t i = 0; i < program.taps.size(); ++i) {
    const TapSlot& tap = program.taps[i];
    Lanes<T> position{};
    for (std::size_t lane = 0; lane < lane_count<T>; ++lane) {
      around(program, tap, state.taps[i], lane,
             [&](std::uint32_t node, T weight) { position[lane] += weight * state.x[node][lane]; });
    }
    state.v[tap.node] = position - state.x[tap.node];
    state.x[tap.node] = position;
  }
}

// What acts on the points goes to the nodes around them.
template <class T>
void spread_taps(const Program& program, State<T>& state) {
  for (std::size_t i = 0; i < program.taps.size(); ++i) {
    const TapSlot& tap = program.taps[i];
    const Lanes<T> force = state.force[tap.node];
    state.force[tap.node] = Lanes<T>{};
    for (std::size_t lane = 0; lane < lane_count<T>; ++lane) {
      around(program, tap, state.taps[i], lane, [&](std::uint32_t node, T weight) {
        state.force[node][lane] += weight * force[lane];
      });
    }
  }
}

// The force at a point is that of the nodes around it, interpolated.
template <class T>
Lanes<T> force_at(const Program& program, const State<T>& state, std::uint32_t node) {
  for (std::size_t i = 0; i < program.taps.size(); ++i) {
    if (program.taps[i].node == node) {
      Lanes<T> force{};
      for (std::size_t lane = 0; lane < lane_count<T>; ++lane) {
        around(program, program.taps[i], state.taps[i], lane, [&](std::uint32_t near, T weight) {
          force[lane] += weight * state.force[near][lane];
        });
      }
      return force;
    }
  }
  return state.force[node];
}

template <class T>
Lanes<T> read_output(const Program& program, const State<T>& state, const Drive<T>* drive,
                     const OutputSlot& output) {
  if (output.node == Program::no_node) {
    return Lanes<T>{};
  }
  if (!output.is_force) {
    return state.x[output.node];
  }
  Lanes<T> force = force_at(program, state, output.node);
  for (std::size_t i = 0; i < program.inputs.size(); ++i) {
    if (program.inputs[i].is_force && program.inputs[i].node == output.node) {
      force += drive[i].value;
    }
  }
  return force / static_cast<T>(program.rate_ratio * program.rate_ratio);
}

}  // namespace

double coefficient_value(const Program& program, const Coefficient& coefficient,
                         std::span<const double> parameters, double stiffness_factor) {
  const double value =
      evaluate(std::span(program.steps).subspan(coefficient.first, coefficient.count), parameters);
  const double r = program.rate_ratio;
  switch (coefficient.unit) {
    case Unit::plain:
      return value;
    case Unit::stiffness:
      return value * r * r * stiffness_factor;
    case Unit::damping:
      return value * r;
    case Unit::friction:
    case Unit::speed:
      return value * r * std::sqrt(stiffness_factor);
    case Unit::inverse_mass:
      return 1.0 / value;
    case Unit::gravity:
      return value * r * r;
    case Unit::gravity_per_rate:
      return value * r * r / reference_rate_hz;
  }
  return value;
}

template <class T>
State<T>::State(const Program& program)
    : x(program.position.size()),
      v(program.position.size()),
      taps(program.taps.size()),
      force(program.position.size()),
      coefficient(program.coefficients.size()),
      increment(program.coefficients.size()),
      target(program.coefficients.size()),
      is_ramping(program.coefficients.size()) {
  ramping.reserve(program.coefficients.size());
  for (std::size_t lane = 0; lane < lane_count<T>; ++lane) {
    reset_lane(program, *this, lane);
  }
}

template <class T>
void reset_lane(const Program& program, State<T>& state, std::size_t lane) {
  for (std::size_t i = 0; i < state.x.size(); ++i) {
    state.x[i][lane] = static_cast<T>(program.position[i]);
    state.v[i][lane] = static_cast<T>(program.velocity[i]);
    state.force[i][lane] = T(0);
  }
}

template <class T>
void step_direct(const Program& program, State<T>& state, const Drive<T>* drive,
                 const Lanes<T>* audio, Lanes<T>* outputs, std::size_t frames) {
  for (std::size_t frame = 0; frame < frames; ++frame) {
    if (state.ramp_frames > 0) {
      ramp_coefficients(state);
    }
    for (const std::uint32_t c : program.audio_coefficients) {
      state.coefficient[c] = *audio++;
    }
    for (std::size_t i = 0; i < program.inputs.size(); ++i) {
      if (program.inputs[i].is_force) {
        state.force[program.inputs[i].node] += drive[i].value;
      }
    }
    if (!program.taps.empty()) {
      place_taps(program, state);
      spread_taps(program, state);
    }
    step_masses(program, state);
    for (std::size_t i = 0; i < program.inputs.size(); ++i) {
      if (!program.inputs[i].is_force) {
        state.x[program.inputs[i].node] = drive[i].value;
        state.v[program.inputs[i].node] = drive[i].velocity;
      }
    }
    move_taps(program, state);
    step_links(program, state);
    spread_taps(program, state);
    for (const OutputSlot& output : program.outputs) {
      *outputs++ = read_output(program, state, drive, output);
    }
    drive += program.inputs.size();
  }
}

template struct State<float>;
template struct State<double>;
template void reset_lane(const Program&, State<float>&, std::size_t);
template void reset_lane(const Program&, State<double>&, std::size_t);
template void step_direct(const Program&, State<float>&, const Drive<float>*, const Lanes<float>*,
                          Lanes<float>*, std::size_t);
template void step_direct(const Program&, State<double>&, const Drive<double>*,
                          const Lanes<double>*, Lanes<double>*, std::size_t);

}  // namespace ressort
