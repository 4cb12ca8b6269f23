// The walks of the dense kernel, compiled for each instruction set.
#include <type_traits>

#include "core/engine/dense.h"
#include "core/engine/dense_packs.h"
#include "core/engine/laws.h"

namespace ressort::RESSORT_ISA {
namespace {

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

// Count packs for every vector of masses. They stay in registers only where all is inlined.
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
  [[gnu::always_inline]] static void add(Vector& sum, const T* column, T by) {
    for (std::size_t c = 0; c < Count; ++c) {
      sum.pack[c] += load<V>(column + c * lanes) * by;
    }
  }
  // sum += columns * by, one number for each column; in memory they are `in_memory`.
  [[gnu::always_inline]] static void add_columns(Vector& sum, const DenseBody<T>& b,
                                                 const T* columns, const Vector& by,
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
  [[gnu::always_inline]] static void add_sources(Vector& sum, const DenseBody<T>& b,
                                                 const T* matrix) {
    const T* column = matrix + (own_vectors + 2 * b.padded) * stride;
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

template <class T, std::size_t Bytes>
DenseSteps<T> steps_of(std::size_t packs) {
  const auto of = []<std::size_t Count>() {
    using W = Walk<T, Bytes, Count>;
    return DenseSteps<T>{W::step, W::pull, leap_dense<T>, build_dense<T>};
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
  constexpr std::size_t widest = RESSORT_VECTOR_BYTES;
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
