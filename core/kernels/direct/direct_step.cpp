// The loops of the direct kernel, compiled for each instruction set.
#include "core/kernels/direct/direct.h"
#include "core/kernels/passive.h"
#include "core/laws/laws.h"

namespace ressort::RESSORT_ISA {
namespace {

// DirectState, seen in packs.
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
  // Where a node is from another.
  V between(std::size_t a, std::size_t b) const { return x[a] - x[b]; }
  void move(std::size_t node) { shift(node, v[node]); }
  void shift(std::size_t node, V way) { x[node] += way; }
  // One lane's position, `at` being its number in [node][lane].
  T exact(std::size_t at) const { return state.x[at]; }
  void move_to(std::size_t at, T position) {
    state.v[at] = position - state.x[at];
    state.x[at] = position;
  }
  // What the position inputs and the outputs of a frame leave out.
  void take_rests(const Program&) {}
  void give_rests(const Program&) {}

  V* x;
  V* v;
  V* force;
  const V* coefficient;
};

// The same with positions that are sums of two numbers, x + rest. A step's rounding is kept in the
// rest instead of lost, so that a small motion far from 0 is as exact as one at 0.
template <std::size_t Bytes>
struct Summed : View<float, Bytes> {
  using Base = View<float, Bytes>;
  using V = typename Base::V;

  explicit Summed(DirectState<float>& state_in)
      : Base(state_in),
        rest(reinterpret_cast<V*>(state_in.rest)),
        value_rest(reinterpret_cast<const V*>(state_in.value_rest)),
        output_rest(reinterpret_cast<V*>(state_in.output_rest)) {}

  V between(std::size_t a, std::size_t b) const {
    return Base::between(a, b) + (rest[a] - rest[b]);
  }
  void move(std::size_t node) { shift(node, this->v[node]); }
  void shift(std::size_t node, V way) {
    const V y = way + rest[node];
    const V sum = this->x[node] + y;
    rest[node] = y - (sum - this->x[node]);
    this->x[node] = sum;
  }
  double exact(std::size_t at) const {
    return static_cast<double>(this->state.x[at]) + static_cast<double>(this->state.rest[at]);
  }
  void move_to(std::size_t at, double position) {
    this->state.v[at] = static_cast<float>(position - exact(at));
    this->state.x[at] = static_cast<float>(position);
    this->state.rest[at] = static_cast<float>(position - static_cast<double>(this->state.x[at]));
  }
  void take_rests(const Program& program) {
    for (const InputSlot& input : program.inputs) {
      if (!input.is_force) {
        rest[input.node] = *value_rest;
      }
      ++value_rest;
    }
  }
  void give_rests(const Program& program) {
    for (const OutputSlot& output : program.outputs) {
      *output_rest++ = output.is_force ? V{} : rest[output.node];
    }
  }

  V* rest;
  const V* value_rest;
  V* output_rest;
};

// The same after nodes were written: of its own type, so that what is called for
// every sample remains the only one of its kind and is put in its place.
template <class T, std::size_t Bytes>
struct Rewritten : View<T, Bytes> {
  using View<T, Bytes>::View;
};

// The loop over one run's masses; `pull` is what acts on one besides its links.
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

template <class S>
void step_masses(const Program& program, S& s) {
  using V = typename S::V;
  for (const MassRun& run : program.mass_runs) {
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
  for (std::size_t i = program.moving; i < s.state.nodes; ++i) {
    s.force[i] = V{};
  }
}

// The loop over one run's links, of any law.
template <class S, class ForceLaw>
void add_forces(const Program& program, const LinkRun& run, S& s, ForceLaw&& law) {
  using V = typename S::V;
  const Ends* const ends = program.ends.data() + run.first;
  for (std::uint32_t i = 0; i < run.count; ++i) {
    const auto [a, b] = ends[i];
    const V f = law.force(s.between(a, b), s.v[a] - s.v[b]);
    s.force[a] -= f;
    s.force[b] += f;
  }
}

template <class S>
void step_links(const Program& program, S& s) {
  using V = typename S::V;
  for (const LinkRun& run : program.link_runs) {
    if (run.scheme != Scheme::plain) {
      continue;
    }
    const auto c = [&](std::size_t i) { return s.coefficient[run.coefficients[i]]; };
    with_law<V>(run.law, c, [&](const auto& law) { add_forces(program, run, s, law); });
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
  for (std::size_t i = 0; i < program.taps.size(); ++i) {
    for (std::size_t lane = 0; lane < S::lanes; ++lane) {
      const std::size_t node = program.taps[i].node * S::lanes + lane;
      decltype(s.exact(node)) position = 0;
      around(program, s, i, lane,
             [&](std::size_t at, auto weight) { position += weight * s.exact(at); });
      s.move_to(node, position);
    }
  }
}

// What acts on the points goes to the nodes around them.
template <class S>
void spread_taps(const Program& program, S& s) {
  using V = typename S::V;
  using T = Scalar<V>;
  for (std::size_t i = 0; i < program.taps.size(); ++i) {
    const std::uint32_t node = program.taps[i].node;
    const V force = s.force[node];
    s.force[node] = V{};
    for (std::size_t lane = 0; lane < S::lanes; ++lane) {
      around(program, s, i, lane,
             [&](std::size_t at, T weight) { s.state.force[at] += weight * force[lane]; });
    }
  }
}

// Whether a node is a place on a macro; it is then taps[node - taps[0].node].
bool is_place(const Program& program, std::uint32_t node) {
  return !program.taps.empty() && node >= program.taps[0].node;
}

// Calls `use(at, weight)` for what a node stands for in one lane: itself, or what is around it.
template <class S, class Use>
void behind(const Program& program, const S& s, std::uint32_t node, std::size_t lane, Use&& use) {
  if (!is_place(program, node)) {
    return use(node * S::lanes + lane, Scalar<typename S::V>(1));
  }
  around(program, s, node - program.taps[0].node, lane, use);
}

// The links' force at a node; at a place that of the nodes around it, interpolated.
template <class S>
typename S::V force_at(const Program& program, const S& s, std::uint32_t node) {
  using V = typename S::V;
  using T = Scalar<V>;
  V force{};
  for (std::size_t lane = 0; lane < S::lanes; ++lane) {
    behind(program, s, node, lane, [&](std::size_t at, T weight) {
      force[lane] += weight * s.state.force[at];
      force[lane] += s.state.felt == nullptr ? T(0) : weight * s.state.felt[at];
    });
  }
  return force;
}

// How much of what pushes one node is felt at another: all of it where they are one, and between
// two places the product of their weights on every node that both have around them.
template <class S>
typename S::V share(const Program& program, const S& s, std::uint32_t from, std::uint32_t at) {
  using V = typename S::V;
  using T = Scalar<V>;
  V sum{};
  for (std::size_t lane = 0; lane < S::lanes; ++lane) {
    behind(program, s, from, lane, [&](std::size_t pushed, T weight) {
      behind(program, s, at, lane,
             [&](std::size_t felt, T part) { sum[lane] += pushed == felt ? weight * part : T(0); });
    });
  }
  return sum;
}

// Links that are not plain see nodes and places alike.
template <class S>
struct Passive {
  using V = typename S::V;
  using T = Scalar<V>;

  V coefficient(std::uint32_t c) const { return s.coefficient[c]; }
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
  void push(Ends ends, V x, V v) {
    push_node(ends.a, -x, -v);
    push_node(ends.b, x, v);
  }

 private:
  V position(std::uint32_t node) const {
    if (!is_place(program, node)) {
      return s.x[node];
    }
    V position{};
    for (std::size_t lane = 0; lane < S::lanes; ++lane) {
      behind(program, s, node, lane,
             [&](std::size_t at, T weight) { position[lane] += weight * s.state.x[at]; });
    }
    return position;
  }

  V speed(std::uint32_t node) const {
    return is_place(program, node) ? position(node) - s.x[node] : s.v[node];
  }

  // How far one node is moved by a force of 1 at another.
  V give(std::uint32_t from, std::uint32_t at) const {
    if (from == at && !is_place(program, at)) {
      return at < program.moving ? s.coefficient[s.state.inverse_mass[at]] : V{};
    }
    V sum{};
    for (std::size_t lane = 0; lane < S::lanes; ++lane) {
      behind(program, s, from, lane, [&](std::size_t pushed, T weight) {
        behind(program, s, at, lane, [&](std::size_t felt, T part) {
          sum[lane] += pushed == felt ? weight * part * inverse_mass(pushed, lane) : T(0);
        });
      });
    }
    return sum;
  }

  T inverse_mass(std::size_t at, std::size_t lane) const {
    const std::size_t node = at / S::lanes;
    return node < program.moving ? s.state.ramps.value[s.state.inverse_mass[node] * S::lanes + lane]
                                 : T(0);
  }

  void push_node(std::uint32_t node, V x, V v) {
    if (!is_place(program, node)) {
      if (node < program.moving) {
        const V inverse_mass = s.coefficient[s.state.inverse_mass[node]];
        s.shift(node, inverse_mass * x);
        s.v[node] += inverse_mass * v;
      }
      if (s.state.felt != nullptr) {
        reinterpret_cast<V*>(s.state.felt)[node] += v;
      }
      return;
    }
    for (std::size_t lane = 0; lane < S::lanes; ++lane) {
      behind(program, s, node, lane, [&](std::size_t at, T weight) {
        const T part = weight * inverse_mass(at, lane);
        s.state.x[at] += part * x[lane];
        s.state.v[at] += part * v[lane];
        if (s.state.felt != nullptr) {
          s.state.felt[at] += weight * v[lane];
        }
      });
    }
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
  correct(s.state.passive, reinterpret_cast<V*>(s.state.memory), body);
  *reinterpret_cast<V*>(s.state.awake) = V{} + 1;
}

// What acts in the next sample.
template <class S>
void pull(const Program& program, S& s) {
  step_links(program, s);
  spread_taps(program, s);
}

template <class S>
typename S::V read_output(const Program& program, const S& s, const typename S::V* value,
                          const OutputSlot& output) {
  if (!output.is_force) {
    return s.x[output.node];
  }
  auto force = force_at(program, s, output.node);
  for (std::size_t i = 0; i < program.inputs.size(); ++i) {
    if (program.inputs[i].is_force) {
      force += share(program, s, program.inputs[i].node, output.node) * value[i];
    }
  }
  return force / static_cast<Scalar<typename S::V>>(program.rate_ratio * program.rate_ratio);
}

template <class T, std::size_t Bytes, class S = View<T, Bytes>>
void step(const Program& program, DirectState<T>& state, const Block<T>& block) {
  using V = typename S::V;
  S s(state);
  const auto* value = reinterpret_cast<const V*>(block.value);
  const auto* velocity = reinterpret_cast<const V*>(block.velocity);
  const auto* audio = reinterpret_cast<const V*>(block.audio);
  auto* coefficient = reinterpret_cast<V*>(state.ramps.value);
  auto* outputs = reinterpret_cast<V*>(block.outputs);
  const std::size_t inputs = program.inputs.size();
  const bool has_passive = !state.passive.empty();
  if (block.frames == 0) {
    Rewritten<T, Bytes> rewritten(state);
    pull(program, rewritten);
  }
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
    if (!program.taps.empty()) {
      place_taps(program, s);
      spread_taps(program, s);
    }
    step_masses(program, s);
    for (std::size_t i = 0; i < inputs; ++i) {
      if (!program.inputs[i].is_force) {
        s.x[program.inputs[i].node] = value[i];
        s.v[program.inputs[i].node] = velocity[i];
      }
    }
    s.take_rests(program);
    if (has_passive) {
      correct_links(program, s);
    }
    move_taps(program, s);
    pull(program, s);
    for (const OutputSlot& output : program.outputs) {
      *outputs++ = read_output(program, s, value, output);
    }
    s.give_rests(program);
    value += inputs;
    velocity += inputs;
  }
}

template <class T>
DirectStep<T> step_in(std::size_t bytes) {
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

DirectStep<float> compensated_step_in(std::size_t bytes) {
  if constexpr (vector_bytes(Isa::RESSORT_ISA) >= 64) {
    if (bytes == 64) {
      return step<float, 64, Summed<64>>;
    }
  }
  if constexpr (vector_bytes(Isa::RESSORT_ISA) >= 32) {
    if (bytes == 32) {
      return step<float, 32, Summed<32>>;
    }
  }
  return step<float, 16, Summed<16>>;
}

}  // namespace
}  // namespace ressort::RESSORT_ISA

namespace ressort {

template <>
DirectStep<float> direct_step<Isa::RESSORT_ISA, float>(std::size_t bytes) {
  return RESSORT_ISA::step_in<float>(bytes);
}

template <>
DirectStep<double> direct_step<Isa::RESSORT_ISA, double>(std::size_t bytes) {
  return RESSORT_ISA::step_in<double>(bytes);
}

template <>
DirectStep<float> compensated_step<Isa::RESSORT_ISA>(std::size_t bytes) {
  return RESSORT_ISA::compensated_step_in(bytes);
}

}  // namespace ressort
