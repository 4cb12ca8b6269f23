// The loops of the dense kernel, compiled for each instruction set.
#include <type_traits>

#include "core/engine/dense.h"
#include "core/engine/laws.h"

namespace ressort::RESSORT_ISA {
namespace {

constexpr std::size_t own_vectors = 4;  // of DenseBody::matrix, as dense.cpp makes it

template <class V>
V load(const Element<V>* from) {
  V pack;
  __builtin_memcpy(&pack, from, sizeof pack);
  return pack;
}
template <class V>
void store(Element<V>* to, V pack) {
  __builtin_memcpy(to, &pack, sizeof pack);
}

// --- sample by sample -------------------------------------------------------------------------

// The ports' forces of a sample, given to `add(port, force)`. `first` is the x of mass 0.
template <class T>
struct AnyPorts {
  template <class Add>
  void operator()(const DenseBody<T>& b, T, T, Add&& add) const {
    for (std::size_t p = 0; p < b.ports; ++p) {
      const DenseLink& port = b.port[p];
      const T d = b.x[port.a] - b.x[port.b];
      const T v = b.v[port.a] - b.v[port.b];
      const auto c = [&](std::size_t i) { return b.ramps.value[port.coefficients[i]]; };
      with_law<T>(port.law, c(0), c(1), c(2), c(3), c(4), [&](auto&& law) { add(p, law(d, v)); });
    }
  }
};

// The same for one port whose law is chosen already, and whose mass is in a register.
template <class T, class ForceLaw>
struct OnePort {
  ForceLaw law;
  std::uint32_t other;
  T by;  // -1 if mass 0 is its b

  template <class Add>
  void operator()(const DenseBody<T>& b, T x, T v, Add&& add) const {
    add(std::size_t(0), law(by * x - by * b.x[other], by * v - by * b.v[other]));
  }
};

// Count packs for every vector of masses.
template <class T, std::size_t Bytes, std::size_t Count>
struct Walk {
  using V = Pack<T, Bytes>;
  static constexpr std::size_t lanes = Bytes / sizeof(T);
  static constexpr std::size_t stride = Count * lanes;

  struct Vector {
    V pack[Count];
  };

  static Vector vector(const T* from) {
    Vector a;
    for (std::size_t c = 0; c < Count; ++c) {
      a.pack[c] = load<V>(from + c * lanes);
    }
    return a;
  }
  static void put(T* to, const Vector& a) {
    for (std::size_t c = 0; c < Count; ++c) {
      store<V>(to + c * lanes, a.pack[c]);
    }
  }
  // sum += column * by
  static void add(Vector& sum, const T* column, T by) {
    for (std::size_t c = 0; c < Count; ++c) {
      sum.pack[c] += load<V>(column + c * lanes) * by;
    }
  }
  // sum += columns * by, one number for each column; in memory they are `in_memory`.
  static void add_columns(Vector& sum, const DenseBody<T>& b, const T* columns, const Vector& by,
                          const T* in_memory) {
    if constexpr (stride <= 4) {
      // From register to register, and in two chains: this is what the next sample waits for.
      Vector other{};
      for (std::size_t k = 0; k < stride; k += 2) {
        add(sum, columns + k * stride, by.pack[k / lanes][k % lanes]);
        add(other, columns + (k + 1) * stride, by.pack[(k + 1) / lanes][(k + 1) % lanes]);
      }
      for (std::size_t c = 0; c < Count; ++c) {
        sum.pack[c] += other.pack[c];
      }
    } else {
      for (std::size_t k = 0; k < b.masses; ++k) {
        add(sum, columns + k * stride, in_memory[k]);
      }
    }
  }
  static void add_sources(Vector& sum, const DenseBody<T>& b, const T* matrix) {
    const T* column = matrix + (own_vectors + 2 * b.padded) * stride;
    for (std::size_t i = 0; i < b.sources; ++i) {
      add(sum, column, b.x[b.source[i]]);
      add(sum, column + stride, b.v[b.source[i]]);
      column += 2 * stride;
    }
  }
  // A vector of the matrix, `steps` samples on its way.
  template <bool moves>
  static Vector own(const DenseBody<T>& b, std::size_t i, T steps) {
    Vector a = vector(b.matrix + i * stride);
    if constexpr (moves) {
      add(a, b.slope + i * stride, steps);
    }
    return a;
  }

  static void begin(const DenseBody<T>& b) {
    for (std::size_t i = 0; i < b.masses; ++i) {
      b.x[i] = b.state[i];
      b.v[i] = b.state[b.masses + i];
    }
    for (std::size_t i = b.masses; i < stride; ++i) {
      b.x[i] = b.v[i] = T(0);
    }
  }

  static void pull(DenseBody<T>& b) {
    begin(b);
    Vector force{};
    const Vector v = vector(b.v);
    Vector before = vector(b.x);
    for (std::size_t c = 0; c < Count; ++c) {
      before.pack[c] -= v.pack[c];
    }
    T x[stride];
    put(x, before);
    const T* const k = b.matrix + own_vectors * stride;
    add_columns(force, b, k, before, x);
    add_columns(force, b, k + b.padded * stride, v, b.v);
    add_sources(force, b, b.matrix);
    put(b.force, force);
  }

  // What a walk reads and never writes, apart from the body: what is stored cannot mean it.
  static DenseBody<T> constants(const DenseBody<T>& b) {
    DenseBody<T> c;
    c.masses = b.masses;
    c.padded = b.padded;
    c.hands = b.hands;
    c.pushes = b.pushes;
    c.outputs = b.outputs;
    c.ports = b.ports;
    c.sources = b.sources;
    c.port = b.port;
    c.source = b.source;
    c.hand = b.hand;
    c.push = b.push;
    c.heard = b.heard;
    c.unit = b.unit;
    c.ramps = b.ramps;
    c.matrix = b.matrix;
    c.slope = b.slope;
    c.damping_moves = b.damping_moves;
    c.state = b.state;
    c.force = b.force;
    c.port_force = b.port_force;
    c.x = b.x;
    c.v = b.v;
    return c;
  }

  // The next velocity but for what pushes: of the springs' force, and what a mass does by itself.
  template <bool moves>
  static Vector next_velocity(const DenseBody<T>& b, const Vector& x, const Vector& v,
                              const Vector& force, T steps) {
    const Vector inverse_mass = own<moves>(b, 0, steps);
    const Vector own_k = own<moves>(b, 1, steps);
    const Vector own_z = own<moves>(b, 2, steps);
    const Vector weight = own<moves>(b, 3, steps);
    Vector next;
    for (std::size_t c = 0; c < Count; ++c) {
      const V pull = own_k.pack[c] * x.pack[c] + own_z.pack[c] * v.pack[c] + weight.pack[c];
      next.pack[c] = v.pack[c] - pull * inverse_mass.pack[c];
      next.pack[c] += force.pack[c] * inverse_mass.pack[c];
    }
    return next;
  }
  // next += what a force does along one of the units.
  static void push(Vector& next, const DenseBody<T>& b, std::size_t unit,
                   const Vector& inverse_mass, T force) {
    for (std::size_t c = 0; c < Count; ++c) {
      next.pack[c] += load<V>(b.unit + unit * stride + c * lanes) * inverse_mass.pack[c] * force;
    }
  }

  // K x' + Z v' = K x + (K + Z) v' with x' = x + v': only the velocities of a sample are waited
  // for before the next one. A port's force reaches the next velocity without the springs' detour.
  template <bool moves, class Ports>
  static void walk(DenseBody<T>& body, const DenseDrive<T>& block, std::size_t at,
                   std::size_t count, const Ports& all_ports) {
    DenseBody<T> b = constants(body);
    const DenseDrive<T> drive = block;
    const Ports ports = all_ports;
    begin(b);
    const T* const k = b.matrix + own_vectors * stride;
    const T* const kz = k + b.padded * stride;
    Vector x = vector(b.x);
    Vector v = vector(b.v);
    Vector force = vector(b.force);
    T steps = moves ? T(1) : T(0);
    Vector next = next_velocity<moves>(b, x, v, force, steps);
    for (std::size_t n = at; n < at + count; ++n) {
      if constexpr (moves) {
        advance(b.ramps);
      }
      const Vector inverse_mass = own<moves>(b, 0, steps);
      for (std::size_t i = 0; i < b.pushes; ++i) {
        push(next, b, i, inverse_mass, drive.value[b.push[i].input * max_block_frames + n]);
      }
      force = Vector{};
      add_columns(force, b, k, x, b.x);
      v = next;
      for (std::size_t c = 0; c < Count; ++c) {
        x.pack[c] += v.pack[c];
      }
      put(b.x, x);
      put(b.v, v);
      for (std::size_t i = 0; i < b.hands; ++i) {
        b.x[b.hand[i].slot] = drive.value[b.hand[i].input * max_block_frames + n];
        b.v[b.hand[i].slot] = drive.velocity[b.hand[i].input * max_block_frames + n];
      }
      add_columns(force, b, kz, v, b.v);
      add_sources(force, b, b.matrix);
      if constexpr (moves) {
        Vector rise{};
        add_columns(rise, b, b.slope + own_vectors * stride, x, b.x);
        if (b.damping_moves) {
          add_columns(rise, b, b.slope + (own_vectors + b.padded) * stride, v, b.v);
        }
        add_sources(rise, b, b.slope);
        for (std::size_t c = 0; c < Count; ++c) {
          force.pack[c] += rise.pack[c] * steps;
        }
        steps += T(1);
      }
      next = next_velocity<moves>(b, x, v, force, steps);
      const Vector next_inverse_mass = own<moves>(b, 0, steps);
      ports(b, x.pack[0][0], v.pack[0][0], [&](std::size_t p, T pulled) {
        b.port_force[p] = pulled;
        push(next, b, b.pushes + p, next_inverse_mass, pulled);
      });
      for (std::size_t o = 0; o < b.outputs; ++o) {
        drive.outputs[n * b.outputs + o] = b.x[b.heard[o]];
      }
    }
    body.touches = false;
    for (std::size_t p = 0; p < b.ports; ++p) {
      body.touches |= b.port_force[p] != T(0);
      add(force, b.unit + (b.pushes + p) * stride, b.port_force[p]);
    }
    put(b.force, force);
    for (std::size_t i = 0; i < b.masses; ++i) {
      b.state[i] = b.x[i];
      b.state[b.masses + i] = b.v[i];
    }
  }

  static void step(DenseBody<T>& b, const DenseDrive<T>& drive, std::size_t at, std::size_t count,
                   bool moves) {
    if (moves) {
      return walk<true>(b, drive, at, count, AnyPorts<T>{});
    }
    if constexpr (stride <= 4) {
      if (b.ports == 1) {
        const DenseLink& port = b.port[0];
        const std::uint32_t other = port.a == 0 ? port.b : port.a;
        const T by = port.a == 0 ? T(1) : T(-1);
        const auto c = [&](std::size_t i) { return b.ramps.value[port.coefficients[i]]; };
        return with_law<T>(port.law, c(0), c(1), c(2), c(3), c(4), [&]<class F>(F&& law) {
          walk<false>(b, drive, at, count, OnePort<T, std::remove_reference_t<F>>{law, other, by});
        });
      }
    }
    walk<false>(b, drive, at, count, AnyPorts<T>{});
  }
};

// --- block by block ---------------------------------------------------------------------------

constexpr std::size_t widest = RESSORT_VECTOR_BYTES;

template <class T>
using Wide = Pack<T, widest>;

template <class T>
constexpr std::size_t wide_lanes = widest / sizeof(T);

// Calls `some<Count>(row)` for all rows, Count packs at once and at most Most <= 8; rows are whole
// packs.
template <class T, std::size_t Most, class Some>
inline void in_packs(std::size_t rows, Some&& some) {
  std::size_t row = 0;
  for (; row + Most * wide_lanes<T> <= rows; row += Most * wide_lanes<T>) {
    some.template operator()<Most>(row);
  }
  const auto rest = [&]<std::size_t Count>() {
    if constexpr (Count < Most) {
      some.template operator()<Count>(row);
    }
  };
  switch ((rows - row) / wide_lanes<T>) {
    case 1:
      return rest.template operator()<1>();
    case 2:
      return rest.template operator()<2>();
    case 3:
      return rest.template operator()<3>();
    case 4:
      return rest.template operator()<4>();
    case 5:
      return rest.template operator()<5>();
    case 6:
      return rest.template operator()<6>();
    case 7:
      return rest.template operator()<7>();
    default:
      return;
  }
}

// out = table * factor for Count packs of rows, the table being [column][rows]. In two
// chains: otherwise each column would wait for the one before.
template <class T, std::size_t Count>
void expand_some(const T* table, std::size_t rows, std::size_t columns, const T* factor, T* out) {
  using V = Wide<T>;
  V sum[Count] = {};
  V other[Count] = {};
  const T* const end = factor + columns;
  if (columns % 2 == 1) {
    for (std::size_t i = 0; i < Count; ++i) {
      sum[i] = load<V>(table + i * wide_lanes<T>) * *factor;
    }
    ++factor;
    table += rows;
  }
  for (; factor != end; factor += 2, table += 2 * rows) {
    for (std::size_t i = 0; i < Count; ++i) {
      sum[i] += load<V>(table + i * wide_lanes<T>) * factor[0];
    }
    for (std::size_t i = 0; i < Count; ++i) {
      other[i] += load<V>(table + rows + i * wide_lanes<T>) * factor[1];
    }
  }
  for (std::size_t i = 0; i < Count; ++i) {
    store<V>(out + i * wide_lanes<T>, sum[i] + other[i]);
  }
}

template <class T>
void expand(const T* table, std::size_t rows, std::size_t columns, const T* factor, T* out) {
  in_packs<T, 4>(rows, [&]<std::size_t Count>(std::size_t row) {
    expand_some<T, Count>(table + row, rows, columns, factor, out + row);
  });
}

// out += what the signal u[0..count) does over `length` numbers, `each` numbers a frame.
template <class T>
void respond(const T* response, const T* u, std::size_t count, std::size_t length, std::size_t each,
             T* out) {
  using V = Wide<T>;
  in_packs<T, 4>(length, [&]<std::size_t Count>(std::size_t row) {
    V sum[2][Count] = {};
    const auto add = [&](V(&to)[Count], std::size_t m) {
      for (std::size_t i = 0; i < Count; ++i) {
        to[i] += load<V>(response + length - m * each + row + i * wide_lanes<T>) * u[m];
      }
    };
    const std::size_t reached = (row + Count * wide_lanes<T> + each - 1) / each;
    const std::size_t until = count < reached ? count : reached;
    for (std::size_t m = 0; m + 1 < until; m += 2) {
      add(sum[0], m);
      add(sum[1], m + 1);
    }
    if (until % 2 == 1) {
      add(sum[0], until - 1);
    }
    for (std::size_t i = 0; i < Count; ++i) {
      T* const to = out + row + i * wide_lanes<T>;
      store<V>(to, load<V>(to) + (sum[0][i] + sum[1][i]));
    }
  });
}

// The least number in a pack.
template <class T>
T least_of(const Wide<T>& pack) {
  T least = pack[0];
  for (std::size_t i = 1; i < wide_lanes<T>; ++i) {
    least = pack[i] < least ? pack[i] : least;
  }
  return least;
}

// How far d (or a velocity) is from where the law acts; it acts below 0.
template <class V, class T>
V distance(const DenseBody<T>& b, const DenseLink& port, V d) {
  const auto c = [&](std::size_t i) { return b.ramps.value[port.coefficients[i]]; };
  switch (port.law) {
    case Law::contact:
      return V{} - c(2) - d;
    case Law::clipped_contact:
      return V{} - c(4) - d;
    default:
      return absolute(d) - c(1);
  }
}

// What one leap works on.
template <class T>
struct Leap {
  using V = Wide<T>;
  static constexpr std::size_t lanes = wide_lanes<T>;

  const DenseBody<T>& b;
  const DenseDrive<T>& drive;
  std::size_t at;
  std::size_t count;
  T* heard = b.scratch;
  T* motion = heard + dense_frames * b.outputs;
  T* next = motion + dense_frames;
  T* shifted = next + b.rows;

  bool is_silent(const T* u) const {
    if (count == dense_frames) {
      V least{};
      for (std::size_t n = 0; n < dense_frames; n += lanes) {
        least = select(load<V>(u + n) != V{}, V{} - 1, least);
      }
      return !(least_of<T>(least) < T(0));
    }
    std::size_t n = 0;
    while (n < count && u[n] == T(0)) {
      ++n;
    }
    return n == count;
  }

  // The signals over the leap, or nothing where one is silent.
  void listen() {
    for (std::size_t s = 0; s < b.signals; ++s) {
      const DenseSignal& slot = b.signal[s];
      const bool is_velocity = slot.kind == DenseSignal::Kind::velocity;
      const T* const input =
          (is_velocity ? drive.velocity : drive.value) + slot.input * max_block_frames + at;
      const T* u = input;
      if (slot.kind != DenseSignal::Kind::force) {
        T* const late = shifted + s * dense_frames;
        const std::uint32_t hand = b.source[slot.at];
        late[0] = is_velocity ? b.v[hand] : b.x[hand];
        for (std::size_t n = 1; n < count; ++n) {
          late[n] = input[n - 1];
        }
        u = late;
      }
      b.sounding[s] = is_silent(u) ? nullptr : u;
    }
  }

  // The first frame in which the port's law acts, or count.
  std::size_t first_touch(std::size_t p) {
    const DenseLink& port = b.port[p];
    expand(b.port_table + p * b.columns * dense_frames, dense_frames, b.columns, b.state, motion);
    for (std::size_t s = 0; s < b.signals; ++s) {
      if (const T* const u = b.sounding[s]) {
        respond(b.port_response + (s * b.ports + p) * 2 * dense_frames, u, count, dense_frames,
                std::size_t(1), motion);
      }
    }
    const bool is_bow = port.law == Law::bow;
    const auto add_end = [&](std::uint32_t slot, std::uint32_t hand, bool is_mass, T by) {
      if (is_mass) {
        return;
      }
      if (hand == no_hand) {
        const T still = by * (is_bow ? b.v[slot] : b.x[slot]);
        for (std::size_t n = 0; n < dense_frames; n += lanes) {
          store<V>(motion + n, load<V>(motion + n) + still);
        }
        return;
      }
      const T* const moved = (is_bow ? drive.velocity : drive.value) + hand * max_block_frames + at;
      for (std::size_t n = 0; n < dense_frames && count == dense_frames; n += lanes) {
        store<V>(motion + n, load<V>(motion + n) + load<V>(moved + n) * by);
      }
      for (std::size_t n = 0; n < count && count < dense_frames; ++n) {
        motion[n] += by * moved[n];
      }
    };
    add_end(port.a, port.hand_a, port.a_moves, T(1));
    add_end(port.b, port.hand_b, port.b_moves, T(-1));
    if (count == dense_frames) {
      V least = distance(b, port, load<V>(motion));
      for (std::size_t n = lanes; n < dense_frames; n += lanes) {
        const V here = distance(b, port, load<V>(motion + n));
        least = select(here < least, here, least);
      }
      if (!(least_of<T>(least) < T(0))) {
        return count;
      }
    }
    std::size_t n = 0;
    while (n < count && !(distance(b, port, motion[n]) < T(0))) {
      ++n;
    }
    return n;
  }

  void hear() {
    const std::size_t length = dense_frames * b.outputs;
    const bool is_whole = count == dense_frames;
    T* const to = drive.outputs + at * b.outputs;
    T* const out = is_whole ? to : heard;
    expand(b.heard_table, length, b.columns, b.state, out);
    for (std::size_t s = 0; s < b.signals; ++s) {
      if (const T* const u = b.sounding[s]) {
        respond(b.heard_response + s * 2 * length, u, count, length, b.outputs, out);
      }
    }
    for (std::size_t i = 0; i < count * b.outputs && !is_whole; ++i) {
      to[i] = out[i];
    }
  }

  void add_next() {
    for (std::size_t i = 0; i < b.rows; i += lanes) {
      store<V>(b.state + i, load<V>(b.state + i) + load<V>(next + i));
    }
  }

  void jump() {
    for (std::size_t power = 0; power < dense_powers; ++power) {
      if ((count >> power & 1) != 0) {
        expand(b.jump + power * b.columns * b.rows, b.rows, b.columns, b.state, next);
        add_next();
      }
    }
    for (std::size_t s = 0; s < b.signals; ++s) {
      if (const T* const u = b.sounding[s]) {
        const T* const late = b.injection + (s + 1) * dense_frames * b.rows - count * b.rows;
        expand(late, b.rows, count, u, next);
        add_next();
      }
    }
    for (std::size_t i = 0; i < b.hands; ++i) {
      const std::size_t last = b.hand[i].input * max_block_frames + at + count - 1;
      b.x[b.hand[i].slot] = drive.value[last];
      b.v[b.hand[i].slot] = drive.velocity[last];
    }
  }
};

template <class T>
std::size_t leap(DenseBody<T>& b, const DenseDrive<T>& drive, std::size_t at, std::size_t count) {
  Leap<T> l{b, drive, at, count};
  l.listen();
  for (std::size_t p = 0; p < b.ports; ++p) {
    l.count = l.first_touch(p);
  }
  if (l.count > 0) {
    l.hear();
    l.jump();
  }
  return l.count;
}

template <class T, std::size_t Bytes>
DenseSteps<T> steps_of(std::size_t packs) {
  const auto of = []<std::size_t Count>() {
    using W = Walk<T, Bytes, Count>;
    return DenseSteps<T>{W::step, W::pull, leap<T>, build_dense<T>};
  };
  if (packs == 1) {
    return of.template operator()<1>();
  }
  if (packs == 2) {
    return of.template operator()<2>();
  }
  if (packs == 3) {
    return of.template operator()<3>();
  }
  if (packs == 4) {
    return of.template operator()<4>();
  }
  return of.template operator()<most_dense_masses * sizeof(T) / Bytes>();
}

}  // namespace

template <class T>
DenseSteps<T> dense_steps(std::size_t masses) {
  constexpr Isa isa = widest == 64 ? Isa::v4 : widest == 32 ? Isa::v3 : Isa::base;
  const auto [bytes, packs] = dense_packs(masses, sizeof(T), isa);
  if constexpr (widest >= 64) {
    if (bytes == 64) {
      return steps_of<T, 64>(packs);
    }
  }
  if constexpr (widest >= 32) {
    if (bytes == 32) {
      return steps_of<T, 32>(packs);
    }
  }
  return steps_of<T, 16>(packs);
}

template DenseSteps<float> dense_steps(std::size_t);
template DenseSteps<double> dense_steps(std::size_t);

}  // namespace ressort::RESSORT_ISA
