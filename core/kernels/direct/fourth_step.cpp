// The loops of the fourth-order kernel, compiled for each instruction set.
#include "core/kernels/direct/fourth.h"
#include "core/laws/laws.h"

namespace ressort::RESSORT_ISA {
namespace {

// FourthState, seen in packs.
template <class T, std::size_t Bytes>
struct View {
  using V = Pack<T, Bytes>;
  static constexpr std::size_t lanes = Bytes / sizeof(T);

  explicit View(FourthState<T>& state_in)
      : state(state_in),
        x(reinterpret_cast<V*>(state.x)),
        v(reinterpret_cast<V*>(state.v)),
        force(reinterpret_cast<V*>(state.force)),
        damping(reinterpret_cast<V*>(state.damping)),
        ahead(reinterpret_cast<V*>(state.ahead)),
        faster(reinterpret_cast<V*>(state.faster)),
        coefficient(reinterpret_cast<const V*>(state.ramps.value)) {}

  FourthState<T>& state;
  V* x;
  V* v;
  V* force;
  V* damping;
  V* ahead;
  V* faster;
  const V* coefficient;
};

// Where masses are going, and what their own springs make of it.
template <class S>
void look_ahead(const Program& program, S& s) {
  using V = typename S::V;
  using T = Scalar<V>;
  for (const MassRun& run : program.mass_runs) {
    const V w = s.coefficient[run.inverse_mass];
    const V twelfth = w / T(12);
    const V half = w / T(2);
    const V k = run.is_oscillator ? s.coefficient[run.stiffness] : V{};
    const V z = run.is_oscillator ? s.coefficient[run.damping] : V{};
    const V g = run.has_gravity ? s.coefficient[run.gravity] : V{};
    for (std::uint32_t i = run.first; i < run.first + run.count; ++i) {
      const V own = z * s.v[i];
      const V force = s.force[i] - k * s.x[i] - own - g;
      const V ahead = (force - s.damping[i] + own) * twelfth;
      const V faster = force * half;
      s.ahead[i] = ahead;
      s.faster[i] = faster;
      s.force[i] = force - k * ahead - z * faster;
    }
  }
}

template <class S>
void move_masses(const Program& program, S& s) {
  using V = typename S::V;
  for (const MassRun& run : program.mass_runs) {
    const V w = s.coefficient[run.inverse_mass];
    for (std::uint32_t i = run.first; i < run.first + run.count; ++i) {
      s.v[i] += s.force[i] * w;
      s.x[i] += s.v[i];
      s.force[i] = V{};
      s.damping[i] = V{};
    }
  }
  for (std::size_t i = program.moving; i < s.state.nodes; ++i) {
    s.force[i] = V{};
  }
}

// What the springs and dampers pull besides, for masses that are ahead and faster.
template <class S>
void correct_springs(const Program& program, const Fourth& form, S& s) {
  using V = typename S::V;
  for (const FourthLinks& links : form.springs) {
    const LinkRun& run = program.link_runs[links.run];
    const V k = s.coefficient[run.coefficients[0]];
    const V z = s.coefficient[run.coefficients[1]];
    const Ends* const ends = program.ends.data() + links.first;
    for (std::uint32_t i = 0; i < links.count; ++i) {
      const auto [a, b] = ends[i];
      const V f = laws::Spring<V>{k, z}.force(s.ahead[a] - s.ahead[b], s.faster[a] - s.faster[b]);
      s.force[a] -= f;
      s.force[b] += f;
    }
  }
}

template <class S>
void pull_springs(const Program& program, const Fourth& form, S& s) {
  using V = typename S::V;
  for (const FourthLinks& links : form.springs) {
    const LinkRun& run = program.link_runs[links.run];
    const V k = s.coefficient[run.coefficients[0]];
    const V z = s.coefficient[run.coefficients[1]];
    const Ends* const ends = program.ends.data() + links.first;
    for (std::uint32_t i = 0; i < links.count; ++i) {
      const auto [a, b] = ends[i];
      const V damping = z * (s.v[a] - s.v[b]);
      const V f = k * (s.x[a] - s.x[b]) + damping;
      s.damping[a] -= damping;
      s.damping[b] += damping;
      s.force[a] -= f;
      s.force[b] += f;
    }
  }
}

// The loop over some links, for any law of (d, v).
template <class S, class ForceLaw>
void add_forces(const Program& program, const FourthLinks& links, S& s, ForceLaw&& law) {
  using V = typename S::V;
  const Ends* const ends = program.ends.data() + links.first;
  for (std::uint32_t i = 0; i < links.count; ++i) {
    const auto [a, b] = ends[i];
    const V f = law.force(s.x[a] - s.x[b], s.v[a] - s.v[b]);
    s.force[a] -= f;
    s.force[b] += f;
  }
}

template <class S>
void pull_others(const Program& program, const Fourth& form, S& s) {
  using V = typename S::V;
  for (const FourthLinks& links : form.others) {
    const LinkRun& run = program.link_runs[links.run];
    const auto c = [&](std::size_t i) { return s.coefficient[run.coefficients[i]]; };
    with_law<V>(run.law, c, [&](const auto& law) { add_forces(program, links, s, law); });
  }
}

// Calls `use(at, weight)` for the up to four nodes around a tap's place in one lane; `at` is the
// node's own number in [node][lane].
template <class S, class Use>
void around(const Program& program, const S& s, std::size_t tap, std::size_t lane, Use&& use) {
  each_corner(s.state.corners[tap * S::lanes + lane], [&](std::uint32_t node, auto weight) {
    use(program.tap_nodes[node] * S::lanes + lane, weight);
  });
}

template <class S>
void place_taps(const Program& program, S& s) {
  const auto* const c = s.state.ramps.value;
  for (std::size_t i = 0; i < program.taps.size(); ++i) {
    const TapSlot& tap = program.taps[i];
    for (std::size_t lane = 0; lane < S::lanes; ++lane) {
      s.state.corners[i * S::lanes + lane] =
          corners_at(tap, c[tap.u * S::lanes + lane], c[tap.v * S::lanes + lane]);
    }
  }
}

// A point moves with the nodes around it, and along them when its coordinate changes.
template <class S>
void move_taps(const Program& program, S& s) {
  using V = typename S::V;
  for (std::size_t i = 0; i < program.taps.size(); ++i) {
    V position{};
    for (std::size_t lane = 0; lane < S::lanes; ++lane) {
      around(program, s, i, lane,
             [&](std::size_t at, auto weight) { position[lane] += weight * s.state.x[at]; });
    }
    const std::uint32_t node = program.taps[i].node;
    s.v[node] = position - s.x[node];
    s.x[node] = position;
  }
}

// What acts on the points goes to the nodes around them.
template <class S>
void spread_taps(const Program& program, S& s) {
  using V = typename S::V;
  for (std::size_t i = 0; i < program.taps.size(); ++i) {
    const std::uint32_t node = program.taps[i].node;
    const V force = s.force[node];
    s.force[node] = V{};
    for (std::size_t lane = 0; lane < S::lanes; ++lane) {
      around(program, s, i, lane,
             [&](std::size_t at, auto weight) { s.state.force[at] += weight * force[lane]; });
    }
  }
}

// What acts in the next sample.
template <class S>
void pull(const Program& program, const Fourth& form, S& s) {
  pull_others(program, form, s);
  spread_taps(program, s);
  pull_springs(program, form, s);
}

template <class S>
typename S::V read_output(const Program& program, const S& s, const typename S::V* value,
                          const OutputSlot& output) {
  if (!output.is_force) {
    return s.x[output.node];
  }
  auto force = s.force[output.node];
  for (std::size_t i = 0; i < program.inputs.size(); ++i) {
    if (program.inputs[i].is_force && program.inputs[i].node == output.node) {
      force += value[i];
    }
  }
  return force / static_cast<Scalar<typename S::V>>(program.rate_ratio * program.rate_ratio);
}

template <class T, std::size_t Bytes>
void step(const Program& program, const Fourth& form, FourthState<T>& state,
          const Block<T>& block) {
  using S = View<T, Bytes>;
  using V = typename S::V;
  S s(state);
  const auto* value = reinterpret_cast<const V*>(block.value);
  const auto* velocity = reinterpret_cast<const V*>(block.velocity);
  const auto* audio = reinterpret_cast<const V*>(block.audio);
  auto* coefficient = reinterpret_cast<V*>(state.ramps.value);
  auto* outputs = reinterpret_cast<V*>(block.outputs);
  const std::size_t inputs = program.inputs.size();
  for (std::size_t frame = 0; frame < block.frames; ++frame) {
    advance(state.ramps);
    for (const std::uint32_t c : program.audio_coefficients) {
      coefficient[c] = *audio++;
    }
    for (std::size_t i = 0; i < inputs; ++i) {
      if (program.inputs[i].is_force) {
        s.force[program.inputs[i].node] += value[i];
      }
    }
    place_taps(program, s);
    spread_taps(program, s);
    look_ahead(program, s);
    correct_springs(program, form, s);
    move_masses(program, s);
    for (std::size_t i = 0; i < inputs; ++i) {
      if (!program.inputs[i].is_force) {
        s.x[program.inputs[i].node] = value[i];
        s.v[program.inputs[i].node] = velocity[i];
      }
    }
    move_taps(program, s);
    pull(program, form, s);
    for (const OutputSlot& output : program.outputs) {
      *outputs++ = read_output(program, s, value, output);
    }
    value += inputs;
    velocity += inputs;
  }
}

template <class T>
FourthStep<T> step_in(std::size_t bytes) {
  if constexpr (vector_bytes(Isa::RESSORT_ISA) >= 64) {
    if (bytes == 64) {
      return step<T, 64>;
    }
  }
  if constexpr (vector_bytes(Isa::RESSORT_ISA) >= 32) {
    if (bytes == 32) {
      return step<T, 32>;
    }
  }
  return step<T, 16>;
}

}  // namespace
}  // namespace ressort::RESSORT_ISA

namespace ressort {

template <>
FourthStep<float> fourth_step<Isa::RESSORT_ISA, float>(std::size_t bytes) {
  return RESSORT_ISA::step_in<float>(bytes);
}

template <>
FourthStep<double> fourth_step<Isa::RESSORT_ISA, double>(std::size_t bytes) {
  return RESSORT_ISA::step_in<double>(bytes);
}

}  // namespace ressort
