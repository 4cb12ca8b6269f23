// The loops of the sparse kernel, compiled for each instruction set.
#include <utility>

#include "core/kernels/laws.h"
#include "core/kernels/sparse/sparse.h"

namespace ressort::RESSORT_ISA {
namespace {

// What the loops of one step know.
template <class T>
struct View {
  static constexpr std::size_t bytes = sparse_bytes(vector_bytes(Isa::RESSORT_ISA));
  static constexpr std::size_t lanes = bytes / sizeof(T);
  using V = Pack<T, bytes>;

  const Program& program;
  const Sparse& sparse;
  SparseState<T>& state;
};

// Keeps a coefficient's value wherever it is used, if it has changed.
template <class T>
void hold(const View<T>& s, std::uint32_t coefficient) {
  const auto [first, count] = s.state.pins[coefficient];
  const T value = s.state.ramps.value[coefficient];
  const std::uint32_t* const places = s.state.places + first;
  if (count == 0 || s.state.held[places[0]] == value) {
    return;
  }
  for (std::uint32_t i = 0; i < count; ++i) {
    s.state.held[places[i]] = value;
  }
}

// In every lane the sum of what one mass looks up, from each number that of `less` taken away.
// Each lane's sum is a number of its own: a pack put together for every row costs more than it
// saves, whatever the instructions. Differences first: they are exact where a network is far from 0
// and moves little.
template <class V>
V look_up(const Scalar<V>* signals, const std::uint32_t* from, const std::uint32_t* end,
          const Scalar<V>* less) {
  constexpr std::size_t lanes = sizeof(V) / sizeof(Scalar<V>);
  return [=]<std::size_t... lane>(std::index_sequence<lane...>) {
    const Scalar<V> own[lanes] = {less[lane]...};
    Scalar<V> sum[lanes] = {};
    for (const std::uint32_t* row = from; row != end; row += lanes) {
      ((sum[lane] += signals[row[lane]] - own[lane]), ...);
    }
    return V{sum[lane]...};
  }
  (std::make_index_sequence<lanes>{});
}

// The same sum as it is.
template <class V>
V look_up(const Scalar<V>* signals, const std::uint32_t* from, const std::uint32_t* end) {
  constexpr std::size_t lanes = sizeof(V) / sizeof(Scalar<V>);
  return [=]<std::size_t... lane>(std::index_sequence<lane...>) {
    Scalar<V> sum[lanes] = {};
    for (const std::uint32_t* row = from; row != end; row += lanes) {
      ((sum[lane] += signals[row[lane]]), ...);
    }
    return V{sum[lane]...};
  }
  (std::make_index_sequence<lanes>{});
}

template <bool has_springs, bool is_pulled, class T>
void move_masses(const View<T>& s) {
  using V = typename View<T>::V;
  constexpr std::size_t lanes = View<T>::lanes;
  const std::size_t moving = s.state.moving;
  const T* const inverse_mass = s.state.held;
  const T* const k = inverse_mass + moving;
  const T* const z = k + moving;
  const T* const g = z + moving;
  const T* const signals = s.state.signals;
  T* const xs = s.state.x;
  T* const vs = s.state.v;
  T* const forces = s.state.force;
  const std::uint32_t* list = s.state.lists;
  const std::uint32_t* const rows = s.state.looked_up;
  for (std::size_t at = 0; at < moving; at += lanes, list += 2) {
    V force = load<V>(forces + at);
    if constexpr (has_springs) {
      force += look_up<V>(signals, rows + list[0], rows + list[1], signals + at);
    }
    if (!has_springs || list[1] != list[2]) {
      force += look_up<V>(signals, rows + list[1], rows + list[2]);
    }
    V x = load<V>(xs + at);
    V v = load<V>(vs + at);
    if constexpr (is_pulled) {
      force -= load<V>(k + at) * x + load<V>(z + at) * v + load<V>(g + at);
    }
    v += force * load<V>(inverse_mass + at);
    x += v;
    store<V>(xs + at, x);
    store<V>(vs + at, v);
    store<V>(forces + at, V{});
  }
}

template <bool has_springs, class T>
void move_masses(const View<T>& s) {
  s.state.is_pulled ? move_masses<has_springs, true>(s) : move_masses<has_springs, false>(s);
}

// What the next sample's springs are made of.
template <class T>
void lay_springs(const View<T>& s) {
  using V = typename View<T>::V;
  const auto& c = s.program.link_runs[s.sparse.springs].coefficients;
  const V k = V{} + s.state.ramps.value[c[0]];
  const V z = V{} + s.state.ramps.value[c[1]];
  const std::size_t slots = s.state.slots;
  const T* const xs = s.state.x;
  const T* const vs = s.state.v;
  T* const ys = s.state.signals;
  for (std::size_t at = 0; at < slots; at += View<T>::lanes) {
    store<V>(ys + at, k * load<V>(xs + at) + z * load<V>(vs + at));
  }
}

// The first lanes of a and b by turns, or the last.
template <bool is_upper, class V>
V interleaved(V a, V b) {
  constexpr std::size_t lanes = sizeof(V) / sizeof(Scalar<V>);
  return [=]<std::size_t... i>(std::index_sequence<i...>) {
    return __builtin_shufflevector(
        a, b, ((i % 2 == 0 ? 0 : lanes) + i / 2 + (is_upper ? lanes / 2 : 0))...);
  }
  (std::make_index_sequence<lanes>{});
}

template <class T>
void lay_pairs(const View<T>& s) {
  using V = typename View<T>::V;
  constexpr std::size_t lanes = View<T>::lanes;
  const std::size_t slots = s.state.slots;
  const T* const xs = s.state.x;
  const T* const vs = s.state.v;
  T* const pairs = s.state.pairs;
  for (std::size_t at = 0; at < slots; at += lanes) {
    const V x = load<V>(xs + at);
    const V v = load<V>(vs + at);
    store<V>(pairs + 2 * at, interleaved<false>(x, v));
    store<V>(pairs + 2 * at + lanes, interleaved<true>(x, v));
  }
}

template <class V>
struct Pairs {
  V x;
  V v;
};

// Positions and velocities for one row, by parts of 16 bytes: one pair of doubles or
// two pairs of floats. Never through memory, where a pack would wait for all its numbers.
template <class T>
Pairs<typename View<T>::V> look_up_pairs(const T* pairs, const std::uint32_t* places) {
  using V = typename View<T>::V;
  using Part = Pack<T, 16>;
  constexpr std::size_t lanes = View<T>::lanes;
  constexpr std::size_t size = sizeof(Part) / sizeof(T);
  const auto part = [=](std::size_t i) {
    if constexpr (size == 2) {
      return load<Part>(pairs + places[i]);
    } else {
      double two[2];
      __builtin_memcpy(&two[0], pairs + places[2 * i], sizeof(double));
      __builtin_memcpy(&two[1], pairs + places[2 * i + 1], sizeof(double));
      const Pack<double, 16> both{two[0], two[1]};
      return reinterpret_cast<Part>(both);
    }
  };
  const auto join = [](Part a, Part b) {
    if constexpr (lanes == size) {
      return a;
    } else {
      return [=]<std::size_t... i>(std::index_sequence<i...>) {
        return __builtin_shufflevector(a, b, i...);
      }
      (std::make_index_sequence<lanes>{});
    }
  };
  const V even = join(part(0), part(2 % (lanes / size * 2)));
  const V odd = join(part(1), part(3 % (lanes / size * 2)));
  return [=]<std::size_t... i>(std::index_sequence<i...>) {
    return Pairs<V>{
        __builtin_shufflevector(
            even, odd,
            (i / size * size + i % size * 2 % size + (i % size < size / 2 ? 0 : lanes))...),
        __builtin_shufflevector(
            even, odd,
            (i / size * size + i % size * 2 % size + 1 + (i % size < size / 2 ? 0 : lanes))...)};
  }
  (std::make_index_sequence<lanes>{});
}

// Flat, so that no compiler leaves the law a function that is called for every row.
template <Law law, class T>
[[gnu::flatten]] void pull_links(const View<T>& s, const SparseLaw& links) {
  using V = typename View<T>::V;
  constexpr std::size_t lanes = View<T>::lanes;
  const T* const xs = s.state.x;
  const T* const vs = s.state.v;
  const T* const pairs = s.state.pairs;
  T* const forces = s.state.force;
  const std::size_t stride = links.stride;
  const std::size_t first = links.row * lanes;
  const T* c = s.state.held + links.held;
  const std::uint32_t* other = s.state.others + first;
  const T* signs = s.state.signs + first;
  T* signal = s.state.signals + s.state.slots + first;
  const SparseOwners* const end = s.state.owners + links.first + links.count;
  for (const SparseOwners* owners = end - links.count; owners != end; ++owners) {
    const std::size_t slot = owners->slot;
    const V x = load<V>(xs + slot);
    const V v = load<V>(vs + slot);
    V own{};
    const T* const last = signal + owners->rows * lanes;
    do {
      const Pairs<V> at = look_up_pairs<T>(pairs, other);
      const V sign = load<V>(signs);
      V f;
      with_law<V>(law, load<V>(c), load<V>(c + lanes), load<V>(c + 2 * lanes),
                  load<V>(c + 3 * lanes), load<V>(c + 4 * lanes),
                  [&](auto&& force) { f = sign * force(sign * (x - at.x), sign * (v - at.v)); });
      f = select(sign == V{}, V{}, f);
      store<V>(signal, f);
      own += f;
      c += stride;
      other += lanes;
      signs += lanes;
      signal += lanes;
    } while (signal != last);
    store<V>(forces + slot, load<V>(forces + slot) - own);
  }
}

template <class T>
void pull_all_links(const View<T>& s) {
  for (std::size_t i = 0; i < s.state.law_count; ++i) {
    const SparseLaw& links = s.state.laws[i];
    [&]<std::size_t... law>(std::index_sequence<law...>) {
      static_cast<void>(((links.law == Law{law} && (pull_links<Law{law}>(s, links), true)) || ...));
    }
    (std::make_index_sequence<std::size_t{static_cast<std::size_t>(Law::clipped_contact)} + 1>{});
  }
}

template <class T>
T read_output(const View<T>& s, const T* value, const OutputSlot& output) {
  constexpr std::size_t lanes = View<T>::lanes;
  const SparseState<T>& state = s.state;
  const std::size_t slot = state.slot[output.node];
  if (!output.is_force) {
    return state.x[slot];
  }
  T force = state.force[slot];
  const std::uint32_t* const list = state.lists + slot / lanes * 2;
  for (std::uint32_t i = list[0]; i < list[2]; i += lanes) {
    const T own = i < list[1] ? state.signals[slot] : T(0);
    force += state.signals[state.looked_up[i + slot % lanes]] - own;
  }
  for (std::size_t i = 0; i < s.program.inputs.size(); ++i) {
    if (s.program.inputs[i].is_force && s.program.inputs[i].node == output.node) {
      force += value[i];
    }
  }
  return force / static_cast<T>(s.program.rate_ratio * s.program.rate_ratio);
}

template <class T>
void step(const Program& program, const Sparse& sparse, SparseState<T>& state,
          const Block<T>& block) {
  const View<T> s{program, sparse, state};
  const T* value = block.value;
  const T* velocity = block.velocity;
  const T* audio = block.audio;
  T* outputs = block.outputs;
  const std::size_t inputs = program.inputs.size();
  const bool has_springs = sparse.springs != Sparse::none;
  for (std::uint32_t c = 0; c < program.coefficients.size(); ++c) {
    hold(s, c);
  }
  for (std::size_t frame = 0; frame < block.frames; ++frame) {
    if (state.ramps.frames > 0) {
      advance(state.ramps);
      for (std::size_t i = 0; i < state.ramps.count; ++i) {
        hold(s, state.ramps.ramping[i]);
      }
    }
    for (const std::uint32_t c : program.audio_coefficients) {
      state.ramps.value[c] = *audio++;
      hold(s, c);
    }
    for (std::size_t i = 0; i < inputs; ++i) {
      if (program.inputs[i].is_force && program.inputs[i].node < program.moving) {
        state.force[state.slot[program.inputs[i].node]] += value[i];
      }
    }
    has_springs ? move_masses<true>(s) : move_masses<false>(s);
    for (std::size_t i = 0; i < inputs; ++i) {
      if (!program.inputs[i].is_force) {
        state.x[state.slot[program.inputs[i].node]] = value[i];
        state.v[state.slot[program.inputs[i].node]] = velocity[i];
      }
    }
    if (has_springs) {
      lay_springs(s);
    }
    if (state.law_count > 0) {
      lay_pairs(s);
      pull_all_links(s);
    }
    for (const OutputSlot& output : program.outputs) {
      *outputs++ = read_output(s, value, output);
    }
    value += inputs;
    velocity += inputs;
  }
}

}  // namespace
}  // namespace ressort::RESSORT_ISA

namespace ressort {

template <>
SparseStep<float> sparse_step<Isa::RESSORT_ISA, float>() {
  return RESSORT_ISA::step<float>;
}

template <>
SparseStep<double> sparse_step<Isa::RESSORT_ISA, double>() {
  return RESSORT_ISA::step<double>;
}

}  // namespace ressort
