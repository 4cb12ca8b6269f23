// The loops of the grid kernel, compiled for each instruction set.
#include <algorithm>
#include <utility>

#include "core/kernels/grid/grid.h"
#include "core/kernels/passive/passive.h"
#include "core/laws/laws.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

// Constants of one step.
template <class T, std::size_t Bytes>
struct View {
  static constexpr std::size_t lanes = Bytes / sizeof(T);
  using V = Pack<T, Bytes>;

  const Program& program;
  const Grid& grid;
  GridState<T>& state;
};

// Calls use.operator()<n>() for a run-time count 1 <= n <= most.
template <std::size_t most, class Use>
void with_count(std::size_t count, Use&& use) {
  [&]<std::size_t... n>(std::index_sequence<n...>) {
    static_cast<void>(((count == n + 1 && (use.template operator()<n + 1>(), true)) || ...));
  }
  (std::make_index_sequence<most>{});
}

// The own spring and gravity of the grid's masses, and their motion.
template <class T>
struct Mover {
  Mover(const MassRun& run, const T* coefficient)
      : inverse_mass(coefficient[run.inverse_mass]),
        k(run.is_oscillator ? coefficient[run.stiffness] : T(0)),
        z(run.is_oscillator ? coefficient[run.damping] : T(0)),
        g(run.has_gravity ? coefficient[run.gravity] : T(0)) {}
  T inverse_mass;
  T k;
  T z;
  T g;
};

// Shift the lanes of y by one, taking the missing lane from the adjacent pack.
template <class V, std::size_t... I>
V up(V before, V y, std::index_sequence<I...>) {
  return __builtin_shufflevector(before, y, sizeof...(I), (sizeof...(I) + 1 + I)...);
}
template <class V, std::size_t... I>
V down(V y, V ahead, std::index_sequence<I...>) {
  return __builtin_shufflevector(y, ahead, (I + 1)..., sizeof...(I) + 1);
}

// Returns whether both neighbours in the row are among a slot's offsets.
inline bool has_row(const GridSegment& segment) {
  const auto& offsets = segment.offsets;
  return std::find(offsets.begin(), offsets.end(), -1) != offsets.end() &&
         std::find(offsets.begin(), offsets.end(), 1) != offsets.end();
}

// Steps segments with n offsets (symplectic Euler): computes forces from y, moves the masses, and
// stores their new y. Neighbours within the row come from lane shifts, because loads of them would
// straddle two cache lines.
template <std::size_t n, bool is_row, bool is_pulled, bool is_forward, class T, std::size_t Bytes>
void move_segments(const View<T, Bytes>& s, const GridSegment* segment, std::size_t count,
                   const Mover<T>& mover) {
  using V = typename View<T, Bytes>::V;
  constexpr std::ptrdiff_t lanes = View<T, Bytes>::lanes;
  const LinkRun& run = s.program.link_runs[s.grid.spring_run];
  const V k = V{} + s.state.ramps.value[run.coefficients[0]];
  const V z = V{} + s.state.ramps.value[run.coefficients[1]];
  const V inverse_mass = V{} + mover.inverse_mass;
  const V pull_k = V{} + mover.k;
  const V pull_z = V{} + mover.z;
  const V pull_g = V{} + mover.g;
  constexpr std::ptrdiff_t direction = is_forward ? 1 : -1;
  constexpr auto other_lanes = std::make_index_sequence<View<T, Bytes>::lanes - 1>{};
  const T* const all_weights = s.state.weights;
  for (std::size_t i = 0; i < count; ++i, segment += direction) {
    constexpr std::size_t others = is_row ? n - 2 : n;
    const T* sum_of[n] = {};
    std::size_t found = 0;
    for (const std::int32_t offset : segment->offsets) {
      if (!is_row || (offset != 1 && offset != -1)) {
        sum_of[found++] = s.state.y + offset;
      }
    }
    const T* const ys = s.state.y;
    T* const next_ys = s.state.next_y;
    T* const xs = s.state.x;
    T* const vs = s.state.v;
    const std::ptrdiff_t first = segment->first;
    const std::ptrdiff_t last = first + segment->count - lanes;
    const std::ptrdiff_t end = is_forward ? last + lanes : first - lanes;
    const std::uint32_t* stamp =
        s.state.stamp + ((is_forward ? first : last) - s.grid.first) / lanes;
    // The current pack of a row and the one before.
    V here{};
    V passed{};
    if constexpr (is_row) {
      here = load<V>(ys + (is_forward ? first : last));
      passed += ys[is_forward ? first - 1 : last + lanes];
    }
    for (std::ptrdiff_t at = is_forward ? first : last; at != end; at += direction * lanes) {
      const T* const weights = all_weights + *stamp * (2 * lanes);
      stamp += direction;
      // Takes differences first: they are exact when the network is far from 0 and moves little.
      V y;
      V sum;
      if constexpr (is_row) {
        y = here;
        const std::ptrdiff_t next = at + direction * lanes;
        here = next == end ? V{} + ys[is_forward ? end : first - 1] : load<V>(ys + next);
        sum = (up(is_forward ? passed : here, y, other_lanes) - y) +
              (down(y, is_forward ? here : passed, other_lanes) - y);
        passed = y;
      } else {
        y = load<V>(ys + at);
        sum = load<V>(sum_of[0] + at) - y;
      }
      for (std::size_t j = is_row ? 0 : 1; j < others; ++j) {
        sum += load<V>(sum_of[j] + at) - y;
      }
      V x = load<V>(xs + at);
      V v = load<V>(vs + at);
      if constexpr (is_pulled) {
        sum -= pull_k * x + pull_z * v + pull_g;
      }
      const V force = load<V>(weights) * sum + load<V>(weights + lanes) * y;
      v += force * inverse_mass;
      x += v;
      store<V>(vs + at, v);
      store<V>(xs + at, x);
      store<V>(next_ys + at, k * x + z * v);
    }
  }
}

template <std::size_t n, bool is_row, class T, std::size_t Bytes>
auto moving(bool is_pulled, bool is_forward) {
  return is_pulled    ? is_forward ? move_segments<n, is_row, true, true, T, Bytes>
                                   : move_segments<n, is_row, true, false, T, Bytes>
            : is_forward ? move_segments<n, is_row, false, true, T, Bytes>
                      : move_segments<n, is_row, false, false, T, Bytes>;
}

// Alternates direction between samples. The slots stepped last are first in the next sample, while
// they are still in the cache, and next_y can overwrite values of y that are no longer needed.
template <class T, std::size_t Bytes>
void step_segments(const View<T, Bytes>& s, const Mover<T>& mover, bool is_pulled) {
  const auto& segments = s.grid.segments;
  for (std::size_t i = 0; i < segments.size();) {
    const GridSegment* const first = &segments[s.state.is_forward ? i : segments.size() - 1 - i];
    const std::size_t offsets = first->offsets.size();
    const bool is_row = has_row(*first);
    const auto is_alike = [&](const GridSegment& segment) {
      return segment.offsets.size() == offsets && has_row(segment) == is_row;
    };
    std::size_t count = 1;
    while (i + count < segments.size() &&
           is_alike(*(s.state.is_forward ? first + count : first - count))) {
      ++count;
    }
    with_count<most_grid_offsets>(offsets, [&]<std::size_t n>() {
      const auto move = is_row ? moving<n, n >= 2, T, Bytes>(is_pulled, s.state.is_forward)
                               : moving<n, false, T, Bytes>(is_pulled, s.state.is_forward);
      move(s, first, count, mover);
    });
    i += count;
  }
  T* const beyond = s.state.next_y + s.grid.first +
                    (s.state.is_forward ? std::ptrdiff_t{s.grid.count} : -s.state.shift);
  for (std::ptrdiff_t i = 0; i < s.state.shift; ++i) {
    beyond[i] = T(0);
  }
}

// Computes the forces of links with n offsets in the packs [begin, end), stored offset by offset.
// Flattened, so that the compiler inlines the law.
template <std::size_t n, class T, std::size_t Bytes, class ForceLaw>
[[gnu::flatten]] void pull_links(const View<T, Bytes>& s, const GridLinks& links, std::size_t row,
                                 std::size_t begin, std::size_t end, ForceLaw law) {
  using V = typename View<T, Bytes>::V;
  constexpr std::size_t lanes = View<T, Bytes>::lanes;
  const T* const xs = s.state.x + s.grid.first;
  const T* const vs = s.state.v + s.grid.first;
  const T* other_x[n];
  const T* other_v[n];
  T* force[n];
  for (std::size_t i = 0; i < n; ++i) {
    other_x[i] = xs + links.offsets[i];
    other_v[i] = vs + links.offsets[i];
    force[i] = s.state.link_force + (row + i) * s.grid.slots + s.grid.first;
  }
  const std::uint32_t* const stamp = s.state.stamp;
  const T* const weights = s.state.weights + (1 + row) * lanes;
  const std::size_t stamp_size = (1 + s.state.rows) * lanes;
  for (std::size_t pack = begin; pack < end; ++pack) {
    const std::size_t at = pack * lanes;
    const T* const is_linked = weights + stamp[pack] * stamp_size;
    const V x = load<V>(xs + at);
    const V v = load<V>(vs + at);
    for (std::size_t i = 0; i < n; ++i) {
      const V f = law(x - load<V>(other_x[i] + at), v - load<V>(other_v[i] + at));
      store<V>(force[i] + at, f * load<V>(is_linked + i * lanes));
    }
  }
}

template <class T, std::size_t Bytes>
void compute_links(const View<T, Bytes>& s, std::size_t begin, std::size_t end) {
  using V = typename View<T, Bytes>::V;
  std::size_t row = 0;
  const T* c = s.state.held;
  for (const GridLinks& links : s.grid.links) {
    const Law law = s.program.link_runs[links.run].law;
    const auto value = [&](std::size_t i) { return V{} + c[i]; };
    with_law<V>(law, value, [&](const auto& exact) {
      const auto f = [exact](V d, V v) { return exact.force(d, v); };
      with_count<most_grid_offsets / 2>(links.offsets.size(), [&]<std::size_t n>() {
        if (links.is_reversed) {
          pull_links<n>(s, links, row, begin, end, [f](V d, V v) { return -f(-d, -v); });
        } else {
          pull_links<n>(s, links, row, begin, end, f);
        }
      });
    });
    row += links.offsets.size();
    c += most_law_arguments;
  }
}

// Moves the masses in the packs [begin, end) by the forces of n offsets.
template <std::size_t n, bool is_pulled, class T, std::size_t Bytes>
void move_packs(const View<T, Bytes>& s, const Mover<T>& mover, std::size_t begin,
                std::size_t end) {
  using V = typename View<T, Bytes>::V;
  constexpr std::size_t lanes = View<T, Bytes>::lanes;
  const T* from_here[n];
  const T* from_below[n];
  for (std::size_t i = 0; i < n; ++i) {
    from_here[i] = s.state.link_force + i * s.grid.slots + s.grid.first;
    from_below[i] = from_here[i] - s.state.offset[i];
  }
  const V inverse_mass = V{} + mover.inverse_mass;
  const V k = V{} + mover.k;
  const V z = V{} + mover.z;
  const V g = V{} + mover.g;
  T* const xs = s.state.x + s.grid.first;
  T* const vs = s.state.v + s.grid.first;
  const std::uint32_t* const stamp = s.state.stamp;
  const T* const weights = s.state.weights;
  for (std::size_t pack = begin; pack < end; ++pack) {
    const std::size_t at = pack * lanes;
    const V moves = load<V>(weights + stamp[pack] * ((1 + n) * lanes));
    V force = load<V>(from_below[0] + at) - load<V>(from_here[0] + at);
    for (std::size_t i = 1; i < n; ++i) {
      force += load<V>(from_below[i] + at) - load<V>(from_here[i] + at);
    }
    V x = load<V>(xs + at);
    V v = load<V>(vs + at);
    if constexpr (is_pulled) {
      force -= k * x + z * v + g;
    }
    v += force * moves * inverse_mass;
    store<V>(vs + at, v);
    store<V>(xs + at, x + v);
  }
}

// Keeps the current coefficients, with which the next sample computes the grid's links.
template <class T, std::size_t Bytes>
void hold(const View<T, Bytes>& s) {
  T* held = s.state.held;
  for (const GridLinks& links : s.grid.links) {
    for (const std::uint32_t c : s.program.link_runs[links.run].coefficients) {
      *held++ = s.state.ramps.value[c];
    }
  }
  s.state.is_fresh = false;
}

// Computes the link forces of the last sample and moves the masses, some packs at a time, far
// enough apart that no force is read while its store is still pending.
template <class T, std::size_t Bytes>
void step_links(const View<T, Bytes>& s, const Mover<T>& mover, bool is_pulled) {
  constexpr std::size_t stride = 32;
  const std::size_t packs = s.grid.count / View<T, Bytes>::lanes;
  for (std::size_t begin = 0; begin < packs; begin += stride) {
    const std::size_t end = begin + stride < packs ? begin + stride : packs;
    if (!s.state.is_fresh) {
      compute_links(s, begin, end);
    }
    with_count<most_grid_offsets>(s.state.rows, [&]<std::size_t n>() {
      is_pulled ? move_packs<n, true>(s, mover, begin, end)
                : move_packs<n, false>(s, mover, begin, end);
    });
  }
  hold(s);
}

// Steps masses outside the grid; their link forces are in `force`.
template <class T, std::size_t Bytes>
void step_loose(const View<T, Bytes>& s) {
  for (const GridLoose& loose : s.grid.loose) {
    const MassRun& run = s.program.mass_runs[loose.mass_run];
    const Mover<T> mover(run, s.state.ramps.value);
    T& x = s.state.x[loose.slot];
    T& v = s.state.v[loose.slot];
    v -= (mover.k * x + mover.z * v + mover.g) * mover.inverse_mass;
    x += v;
  }
}

// Changes position and velocity of a slot.
template <class T, std::size_t Bytes>
void move(const View<T, Bytes>& s, std::uint32_t slot, T further, T faster) {
  if (s.state.inverse_mass[slot] == grid_fixed) {
    return;
  }
  const T v = s.state.v[slot] + faster;
  const T x = s.state.x[slot] + further;
  s.state.v[slot] = v;
  s.state.x[slot] = x;
  if (!s.grid.segments.empty()) {
    const T* const c = s.state.ramps.value;
    const LinkRun& run = s.program.link_runs[s.grid.spring_run];
    s.state.next_y[slot] = c[run.coefficients[0]] * x + c[run.coefficients[1]] * v;
  }
}

// A force f adds f/M to a mass's velocity and position, which may be done after it has moved.
template <class T, std::size_t Bytes>
void push(const View<T, Bytes>& s, std::uint32_t slot) {
  const T* const c = s.state.ramps.value;
  const std::uint32_t inverse_mass = s.state.inverse_mass[slot];
  const T force = s.state.force[slot];
  s.state.force[slot] = T(0);
  if (inverse_mass == grid_fixed) {
    return;
  }
  const T more = force * c[inverse_mass];
  move(s, slot, more, more);
}

template <class T, std::size_t Bytes>
void push_ports(const View<T, Bytes>& s) {
  for (const std::uint32_t slot : s.grid.ports) {
    push(s, slot);
  }
  for (std::size_t i = 0; i < s.state.pushes; ++i) {
    push(s, s.state.pushed[i]);
  }
  s.state.pushes = 0;
}

// Calls use(slot, weight) for the up to four nodes around a tap's place.
template <class T, std::size_t Bytes, class Use>
void around(const View<T, Bytes>& s, std::size_t tap, Use&& use) {
  each_corner(s.state.corners[tap], [&](std::uint32_t node, T weight) {
    use(s.grid.slot[s.program.tap_nodes[node]], weight);
  });
}

template <class T, std::size_t Bytes>
void place_taps(const View<T, Bytes>& s) {
  const T* const c = s.state.ramps.value;
  for (std::size_t i = 0; i < s.program.taps.size(); ++i) {
    const TapSlot& tap = s.program.taps[i];
    s.state.corners[i] = corners_at(tap, c[tap.u], c[tap.v]);
  }
}

template <class T, std::size_t Bytes>
void move_taps(const View<T, Bytes>& s) {
  for (std::size_t i = 0; i < s.program.taps.size(); ++i) {
    T position = T(0);
    around(s, i, [&](std::uint32_t slot, T weight) { position += weight * s.state.x[slot]; });
    const std::uint32_t point = s.grid.slot[s.program.taps[i].node];
    s.state.v[point] = position - s.state.x[point];
    s.state.x[point] = position;
  }
}

// Distributes the forces on points to the nodes around them.
template <class T, std::size_t Bytes>
void spread_taps(const View<T, Bytes>& s) {
  for (std::size_t i = 0; i < s.program.taps.size(); ++i) {
    const std::uint32_t point = s.grid.slot[s.program.taps[i].node];
    const T force = s.state.force[point];
    s.state.force[point] = T(0);
    around(s, i, [&](std::uint32_t slot, T weight) {
      s.state.force[slot] += weight * force;
      s.state.pushed[s.state.pushes++] = slot;
    });
  }
}

template <class T, std::size_t Bytes>
[[gnu::flatten]] void step_rest(const View<T, Bytes>& s) {
  const T* const c = s.state.ramps.value;
  for (const GridRest& rest : s.grid.rest) {
    const LinkRun& run = s.program.link_runs[rest.run];
    const auto& k = run.coefficients;
    const T weight = rest.is_excess ? T(-1) : T(1);
    const auto value = [&](std::size_t i) { return c[k[i]]; };
    with_law<T>(run.law, value, [&](const auto& law) {
      for (std::uint32_t i = rest.first; i < rest.first + rest.count; ++i) {
        const auto [a, b] = s.grid.rest_ends[i];
        const T f = law.force(s.state.x[a] - s.state.x[b], s.state.v[a] - s.state.v[b]) * weight;
        s.state.force[a] -= f;
        s.state.force[b] += f;
      }
    });
  }
}

// Passive links.
template <class T, std::size_t Bytes>
struct Passive {
  CoefficientView<T> coefficients() const { return {s.state.ramps.value}; }
  T awake() const { return *s.state.awake; }
  T distance_now(Ends ends) const { return s.state.x[ends.a] - s.state.x[ends.b]; }
  T speed_now(Ends ends) const { return s.state.v[ends.a] - s.state.v[ends.b]; }
  T distance(Ends ends) const { return distance_now(ends); }
  T speed(Ends ends) const { return speed_now(ends); }
  T gamma(Ends ends) const { return ends.a == ends.b ? T(0) : give(ends.a) + give(ends.b); }
  void push(Ends ends, T force) {
    shift(ends.a, -force * give(ends.a));
    shift(ends.b, force * give(ends.b));
  }
  void shift(std::uint32_t slot, T way) { move(s, slot, way, way); }
  void add_reaction(std::uint32_t, T) {}
  T give(std::uint32_t slot) const {
    const std::uint32_t inverse_mass = s.state.inverse_mass[slot];
    return inverse_mass == grid_fixed ? T(0) : coefficients()[inverse_mass];
  }

  const View<T, Bytes>& s;
};

template <class T, std::size_t Bytes>
[[gnu::noinline]] void remember_links(const View<T, Bytes>& s) {
  remember(s.state.passive, s.state.memory, Passive<T, Bytes>{s});
}

template <class T, std::size_t Bytes>
[[gnu::noinline]] void correct_links(const View<T, Bytes>& s) {
  Passive<T, Bytes> body{s};
  correct(s.state.passive, s.state.memory, s.state.solver, body);
  *s.state.awake = 1;
}

// Computes the forces that act in the next sample, except those of segments and grid links.
template <class T, std::size_t Bytes>
void pull(const View<T, Bytes>& s) {
  step_rest(s);
  spread_taps(s);
}

template <class T, std::size_t Bytes>
void step(const Program& program, const Grid& grid, GridState<T>& state, const Block<T>& block) {
  const View<T, Bytes> s{program, grid, state};
  const MassRun& masses = program.mass_runs[grid.mass_run];
  const T* value = block.value;
  const T* velocity = block.velocity;
  const T* audio = block.audio;
  T* outputs = block.outputs;
  const std::size_t inputs = program.inputs.size();
  for (std::size_t frame = 0; frame < block.frames; ++frame) {
    advance(state.ramps);
    for (const std::uint32_t c : program.audio_coefficients) {
      state.ramps.value[c] = *audio++;
    }
    if (!state.passive.links.empty()) {
      remember_links(s);
    }
    for (std::size_t i = 0; i < inputs; ++i) {
      if (program.inputs[i].is_force) {
        state.force[grid.slot[program.inputs[i].node]] += value[i];
      }
    }
    place_taps(s);
    spread_taps(s);
    const Mover<T> mover(masses, state.ramps.value);
    const bool is_pulled = masses.is_oscillator || masses.has_gravity;
    grid.segments.empty() ? step_links(s, mover, is_pulled) : step_segments(s, mover, is_pulled);
    step_loose(s);
    push_ports(s);
    for (std::size_t i = 0; i < inputs; ++i) {
      if (!program.inputs[i].is_force) {
        state.x[grid.slot[program.inputs[i].node]] = value[i];
        state.v[grid.slot[program.inputs[i].node]] = velocity[i];
      }
    }
    if (!state.passive.links.empty()) {
      correct_links(s);
    }
    move_taps(s);
    pull(s);
    for (const OutputSlot& output : program.outputs) {
      *outputs++ = state.x[grid.slot[output.node]];
    }
    T* const y = state.y;
    state.y = state.next_y;
    state.next_y = y;
    state.is_forward = !state.is_forward;
    value += inputs;
    velocity += inputs;
  }
}

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA

namespace ressort::kernels {

template <>
GridStep<float> grid_step<Isa::RESSORT_ISA, float>() {
  return RESSORT_ISA::step<float, grid_pack_bytes(Isa::RESSORT_ISA)>;
}

template <>
GridStep<double> grid_step<Isa::RESSORT_ISA, double>() {
  return RESSORT_ISA::step<double, grid_pack_bytes(Isa::RESSORT_ISA)>;
}

}  // namespace ressort::kernels
