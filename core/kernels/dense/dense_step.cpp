// The sample steps of the dense kernel, compiled for each instruction set.
#include <type_traits>
#include <utility>

#include "core/kernels/dense/dense.h"
#include "core/laws/laws.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

// The ports' forces of a sample, given to `add(port, force)`.
template <class T, class Add>
inline void each_port(const DenseBody<T>& b, Add&& add) {
  for (std::size_t p = 0; p < b.ports; ++p) {
    const DenseLink& port = b.port[p];
    const T d = b.x[port.a] - b.x[port.b];
    const T v = b.v[port.a] - b.v[port.b];
    const auto c = [&](std::size_t i) { return b.ramps.value[port.coefficients[i]]; };
    with_law<T>(port.law, c, [&](const auto& law) { add(p, law.force(d, v)); });
  }
}

// Any number of ports, in memory.
struct AnyPorts {};

// The same for one port whose law is chosen already, and whose mass is in a register; its other
// end is no mass, and so is where it is before the masses have moved.
template <class T, class ForceLaw>
struct OnePort {
  ForceLaw law;
  std::uint32_t other;
  T by;  // -1 if mass 0 is its b
};

template <std::size_t k, class V, std::size_t... lane>
inline V spread(V pack, std::index_sequence<lane...>) {
  return __builtin_shufflevector(pack, pack, (lane * 0 + k)...);
}

// Count packs for every vector of masses. They stay in registers only where all is inlined.
template <class T, std::size_t Bytes, std::size_t Count>
struct SampleSteps {
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
  // sum += column * by, which is a number or the same one in a whole pack
  template <class By>
  [[gnu::always_inline]] static void add(Vector& sum, const T* column, By by) {
    for (std::size_t c = 0; c < Count; ++c) {
      sum.pack[c] += load<V>(column + c * lanes) * by;
    }
  }
  // sum + other += columns * by, one number for each column. From register to register, and in two
  // chains: this is what the next sample waits for.
  [[gnu::always_inline]] static void add_columns(Vector& sum, Vector& other, const DenseBody<T>& b,
                                                 const T* columns, const Vector& by) {
    for (std::size_t c = 0; c < Count; ++c) {
      if (Count > 4 && c * lanes >= b.masses) {
        break;
      }
      const T* const of_pack = columns + c * lanes * stride;
      [&]<std::size_t... k>(std::index_sequence<k...>) {
        (add(k % 2 == 0 ? sum : other, of_pack + k * stride,
             spread<k>(by.pack[c], std::make_index_sequence<lanes>())),
         ...);
      }
      (std::make_index_sequence<lanes>());
    }
  }
  [[gnu::always_inline]] static void add_columns(Vector& sum, const DenseBody<T>& b,
                                                 const T* columns, const Vector& by) {
    Vector other{};
    add_columns(sum, other, b, columns, by);
    add(sum, other);
  }
  [[gnu::always_inline]] static void add(Vector& sum, const Vector& more) {
    for (std::size_t c = 0; c < Count; ++c) {
      sum.pack[c] += more.pack[c];
    }
  }
  [[gnu::always_inline]] static void add_sources(Vector& sum, const DenseBody<T>& b,
                                                 const T* matrix) {
    const T* column = matrix + (own_vectors + 2 * stride) * stride;
    for (std::size_t i = 0; i < b.sources; ++i) {
      add(sum, column, b.x[b.source[i]]);
      add(sum, column + stride, b.v[b.source[i]]);
      column += 2 * stride;
    }
  }
  // A vector of the matrix, `steps` samples on its way.
  template <bool moves>
  [[gnu::always_inline]] static Vector own(const DenseBody<T>& b, std::size_t i, T steps) {
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
    const T* const k = b.matrix + own_vectors * stride;
    add_columns(force, b, k, before);
    add_columns(force, b, k + stride * stride, v);
    add_sources(force, b, b.matrix);
    for (std::size_t p = 0; p < b.ports; ++p) {
      add(force, b.unit + (b.pushes + p) * stride, b.port_force[p]);
    }
    put(b.force, force);
    b.has_force = true;
  }

  // What sample steps reads and never writes, apart from the body: what is stored cannot mean it.
  static DenseBody<T> constants(const DenseBody<T>& b) {
    DenseBody<T> c;
    c.masses = b.masses;
    c.driven_count = b.driven_count;
    c.pushes = b.pushes;
    c.outputs = b.outputs;
    c.ports = b.ports;
    c.sources = b.sources;
    c.port = b.port;
    c.source = b.source;
    c.driven = b.driven;
    c.push = b.push;
    c.heard = b.heard;
    c.unit = b.unit;
    c.ramps = b.ramps;
    c.matrix = b.matrix;
    c.slope = b.slope;
    c.pace = b.pace;
    c.reach = b.reach;
    c.echo = b.echo;
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
  [[gnu::always_inline]] static Vector next_velocity(const DenseBody<T>& b, const Vector& x,
                                                     const Vector& v, const Vector& force,
                                                     T steps) {
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
  [[gnu::always_inline]] static void push(Vector& next, const DenseBody<T>& b, std::size_t unit,
                                          const Vector& inverse_mass, T force) {
    for (std::size_t c = 0; c < Count; ++c) {
      next.pack[c] += load<V>(b.unit + unit * stride + c * lanes) * inverse_mass.pack[c] * force;
    }
  }

  // Hands move their slots to sample n.
  [[gnu::always_inline]] static void hold(const DenseBody<T>& b, const DenseDrive<T>& drive,
                                          std::size_t n) {
    for (std::size_t i = 0; i < b.driven_count; ++i) {
      b.x[b.driven[i].slot] = drive.value[b.driven[i].input * max_block_frames + n];
      b.v[b.driven[i].slot] = drive.velocity[b.driven[i].input * max_block_frames + n];
    }
  }
  [[gnu::always_inline]] static void hear(const DenseBody<T>& b, const DenseDrive<T>& drive,
                                          std::size_t n) {
    for (std::size_t o = 0; o < b.outputs; ++o) {
      drive.outputs[n * b.outputs + o] = b.x[b.heard[o]];
    }
  }
  static void finish(DenseBody<T>& body) {
    body.touches = false;
    for (std::size_t p = 0; p < body.ports; ++p) {
      body.touches |= body.port_force[p] != T(0);
    }
    for (std::size_t i = 0; i < body.masses; ++i) {
      body.state[i] = body.x[i];
      body.state[body.masses + i] = body.v[i];
    }
  }

  // K x' + Z v' = K x + (K + Z) v' with x' = x + v': only the velocities of a sample are waited
  // for before the next one.
  static void ramp(DenseBody<T>& body, const DenseDrive<T>& block, std::size_t at,
                   std::size_t count) {
    DenseBody<T> b = constants(body);
    const DenseDrive<T> drive = block;
    begin(b);
    const T* const k = b.matrix + own_vectors * stride;
    const T* const kz = k + stride * stride;
    Vector x = vector(b.x);
    Vector v = vector(b.v);
    Vector force = vector(b.force);
    T steps = T(1);
    Vector next = next_velocity<true>(b, x, v, force, steps);
    for (std::size_t n = at; n < at + count; ++n) {
      advance(b.ramps);
      const Vector inverse_mass = own<true>(b, 0, steps);
      for (std::size_t i = 0; i < b.pushes; ++i) {
        push(next, b, i, inverse_mass, drive.value[b.push[i].input * max_block_frames + n]);
      }
      force = Vector{};
      add_columns(force, b, k, x);
      v = next;
      for (std::size_t c = 0; c < Count; ++c) {
        x.pack[c] += v.pack[c];
      }
      put(b.x, x);
      put(b.v, v);
      hold(b, drive, n);
      add_columns(force, b, kz, v);
      add_sources(force, b, b.matrix);
      Vector rise{};
      add_columns(rise, b, b.slope + own_vectors * stride, x);
      if (b.damping_moves) {
        add_columns(rise, b, b.slope + (own_vectors + stride) * stride, v);
      }
      add_sources(rise, b, b.slope);
      for (std::size_t c = 0; c < Count; ++c) {
        force.pack[c] += rise.pack[c] * steps;
      }
      steps += T(1);
      next = next_velocity<true>(b, x, v, force, steps);
      const Vector next_inverse_mass = own<true>(b, 0, steps);
      each_port(b, [&](std::size_t p, T pulled) {
        b.port_force[p] = pulled;
        push(next, b, b.pushes + p, next_inverse_mass, pulled);
      });
      hear(b, drive, n);
    }
    for (std::size_t p = 0; p < b.ports; ++p) {
      add(force, b.unit + (b.pushes + p) * stride, b.port_force[p]);
    }
    put(b.force, force);
    body.has_force = true;
    finish(body);
  }

  // What the springs and weights do to a velocity, where x was one sample before it.
  [[gnu::always_inline]] static Vector pull_at(const DenseBody<T>& b, const Vector& x) {
    Vector pull = vector(b.pace + 3 * stride);
    add_sources(pull, b, b.pace);
    add_columns(pull, b, b.pace + own_vectors * stride, x);
    return pull;
  }

  // The velocity after v, where x was one sample before v; but for what pushes, which `late` adds
  // where the fewest steps follow it. x is known earlier, and v is what everything waits for.
  template <class Late>
  [[gnu::always_inline]] static Vector velocity_after(const DenseBody<T>& b, const Vector& x,
                                                      const Vector& v, Late&& late) {
    Vector after = v;
    add(after, pull_at(b, x));
    Vector other{};
    add_columns(after, other, b, b.pace + (own_vectors + stride) * stride, v);
    late(other);
    add(after, other);
    return after;
  }

  // While coefficients stand. `next` is the next velocity without the ports' forces f. These reach
  // the velocity after that along `echo`, beside the matrices' way: so that a force waits for the
  // force before it, and the masses for the masses, but not one for the other.
  template <class Ports>
  static void samples(DenseBody<T>& body, const DenseDrive<T>& block, std::size_t at,
                      std::size_t count, const Ports& all_ports) {
    constexpr bool is_one = !std::is_same_v<Ports, AnyPorts>;
    const DenseBody<T> b = constants(body);
    const DenseDrive<T> drive = block;
    const Ports ports = all_ports;
    begin(b);
    Vector x = vector(b.x);
    Vector v = vector(b.v);
    Vector next;
    if (body.has_force) {
      next = next_velocity<false>(b, x, v, vector(b.force), T(0));
      for (std::size_t p = 0; p < b.ports; ++p) {
        b.port_force[p] = T(0);  // is in `force`
      }
    } else {
      Vector before = x;
      for (std::size_t c = 0; c < Count; ++c) {
        before.pack[c] -= v.pack[c];
      }
      next = velocity_after(b, before, v, [](Vector&) {});
    }
    const T* const reach = b.reach + b.pushes * stride;
    T pulled = is_one ? b.port_force[0] : T(0);
    for (std::size_t n = at; n < at + count; ++n) {
      for (std::size_t i = 0; i < b.pushes; ++i) {
        add(next, b.reach + i * stride, drive.value[b.push[i].input * max_block_frames + n]);
      }
      hold(b, drive, n);
      const Vector after = velocity_after(b, x, next, [&](Vector& sum) {
        for (std::size_t p = 0; p < (is_one ? 1 : b.ports); ++p) {
          add(sum, b.echo + p * stride, is_one ? pulled : b.port_force[p]);
        }
      });
      v = next;
      for (std::size_t p = 0; p < (is_one ? 1 : b.ports); ++p) {
        add(v, reach + p * stride, is_one ? pulled : b.port_force[p]);
      }
      T force = T(0);
      if constexpr (is_one) {
        const T lead = ports.by * reach[0] * pulled;
        const T free = ports.by * next.pack[0][0];
        const T d = ports.by * (x.pack[0][0] - b.x[ports.other]) + free;
        const T speed = free - ports.by * b.v[ports.other];
        force = ports.law.force(d + lead, speed + lead);
      }
      for (std::size_t c = 0; c < Count; ++c) {
        x.pack[c] += v.pack[c];
      }
      put(b.x, x);
      put(b.v, v);
      if constexpr (is_one) {
        pulled = force;
      } else {
        each_port(b, [&](std::size_t p, T now) { b.port_force[p] = now; });
      }
      hear(b, drive, n);
      next = after;
    }
    if constexpr (is_one) {
      b.port_force[0] = pulled;
    }
    body.has_force = false;
    finish(body);
  }

  static void step(DenseBody<T>& b, const DenseDrive<T>& drive, std::size_t at, std::size_t count,
                   bool moves) {
    if (moves) {
      return ramp(b, drive, at, count);
    }
    if constexpr (Count <= 2) {
      if (b.ports == 1 && b.port[0].a_moves != b.port[0].b_moves) {
        const DenseLink& port = b.port[0];
        const std::uint32_t other = port.a_moves ? port.b : port.a;
        const T by = port.a_moves ? T(1) : T(-1);
        const auto c = [&](std::size_t i) { return b.ramps.value[port.coefficients[i]]; };
        return with_law<T>(port.law, c, [&]<class ForceLaw>(const ForceLaw& law) {
          samples(b, drive, at, count, OnePort<T, ForceLaw>{law, other, by});
        });
      }
    }
    samples(b, drive, at, count, AnyPorts{});
  }
};

// The sample steps of so many packs, one of those that dense_packs() may ask for.
template <class T, std::size_t Bytes, std::size_t... Counts>
DenseSteps<T> steps_of(std::size_t packs, std::index_sequence<Counts...>) {
  constexpr std::size_t most = most_dense_masses * sizeof(T) / Bytes;
  DenseSteps<T> steps{};
  const auto offer = [&]<std::size_t Count>() {
    if constexpr (Count <= most) {
      if (packs == Count) {
        using S = SampleSteps<T, Bytes, Count>;
        steps = {S::step, S::pull, dense_block_step<Isa::RESSORT_ISA, T>,
                 dense_stride<Isa::RESSORT_ISA, T>, build_dense<Isa::RESSORT_ISA, T>};
      }
    }
  };
  (offer.template operator()<Counts>(), ...);
  return steps;
}

template <class T>
DenseSteps<T> steps_for(std::size_t masses) {
  constexpr std::size_t widest = vector_bytes(Isa::RESSORT_ISA);
  const auto [bytes, packs] = dense_packs(masses, sizeof(T), Isa::RESSORT_ISA);
  if constexpr (widest > 32) {
    if (bytes == 32) {
      return steps_of<T, 32>(packs, std::index_sequence<1>());
    }
  }
  if constexpr (widest > 16) {
    if (bytes == 16) {
      return steps_of<T, 16>(packs, std::index_sequence<1>());
    }
  }
  return steps_of<T, widest>(packs, std::index_sequence<1, 2, 3, 4, 8>());
}

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA

namespace ressort::kernels {

template <>
DenseSteps<float> dense_steps<Isa::RESSORT_ISA, float>(std::size_t masses) {
  return RESSORT_ISA::steps_for<float>(masses);
}

template <>
DenseSteps<double> dense_steps<Isa::RESSORT_ISA, double>(std::size_t masses) {
  return RESSORT_ISA::steps_for<double>(masses);
}

}  // namespace ressort::kernels
