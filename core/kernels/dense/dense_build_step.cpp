// The tables of the dense kernel, compiled for each instruction set: coefficients change while
// the sound goes on. In double whatever the precision of the kernel.
//
// Everything is made by doubling: from A^L and what the first L samples need, the next L.
#include "core/kernels/dense/dense.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

constexpr std::size_t lanes = vector_bytes(Isa::RESSORT_ISA) / sizeof(double);
constexpr std::size_t row_length = dense_frames + dense_pad;

using V = Pack<double, vector_bytes(Isa::RESSORT_ISA)>;

template <std::size_t Count>
void combine_some(const double* from, const double* vectors, std::size_t step, const double* factor,
                  std::size_t factor_step, std::size_t terms, double scale, double* to) {
  V sum[Count];
  for (std::size_t j = 0; j < Count; ++j) {
    sum[j] = load<V>(from + j * lanes) * scale;
  }
  for (std::size_t i = 0; i < terms; ++i) {
    const double by = factor[i * factor_step];
    for (std::size_t j = 0; j < Count; ++j) {
      sum[j] += load<V>(vectors + i * step + j * lanes) * by;
    }
  }
  for (std::size_t j = 0; j < Count; ++j) {
    store<V>(to + j * lanes, sum[j]);
  }
}

// to = scale * from + sum of factor[i] * vectors[i], for `length` numbers rounded up to packs.
void combine(const double* from, const double* vectors, std::size_t step, const double* factor,
             std::size_t factor_step, std::size_t terms, double scale, double* to,
             std::size_t length) {
  std::size_t at = 0;
  const auto some = [&]<std::size_t Count>() {
    while (at + (Count - 1) * lanes < length) {
      combine_some<Count>(from + at, vectors + at, step, factor, factor_step, terms, scale,
                          to + at);
      at += Count * lanes;
    }
  };
  some.template operator()<4>();
  some.template operator()<2>();
  some.template operator()<1>();
}

// Where things are in DenseBody::build.
template <class T>
struct Build {
  DenseBody<T>& b;
  double* power = b.build;                        // [column][row] A^L - 1
  double* spare = power + b.columns * b.rows;     // the next
  double* observed = spare + b.columns * b.rows;  // [output or port][column][row_length]
  double* injected = observed + (b.outputs + b.ports) * b.columns * row_length;

  const double* vector(std::size_t i) const { return b.exact + i * b.stride; }

  void put_first_power() {
    const std::size_t n = b.masses;
    const double* const own_k = vector(1);
    const double* const own_z = vector(2);
    const double* const weight = vector(3);
    for (std::size_t i = 0; i < b.columns * b.rows; ++i) {
      power[i] = 0.0;
    }
    for (std::size_t k = 0; k < n; ++k) {
      double* const of_x = power + k * b.rows;
      double* const of_v = power + (n + k) * b.rows;
      const double* const stiff = vector(own_vectors + k);
      const double* const both = vector(own_vectors + b.stride + k);
      for (std::size_t r = 0; r < n; ++r) {
        of_x[r] = of_x[n + r] = (stiff[r] - (r == k ? own_k[k] : 0.0)) * b.exact[r];
        of_v[n + r] = (both[r] - stiff[r] - (r == k ? own_z[k] : 0.0)) * b.exact[r];
        of_v[r] = of_v[n + r] + (r == k ? 1.0 : 0.0);
      }
    }
    if (b.columns > 2 * n) {
      double* const constant = power + 2 * n * b.rows;
      for (std::size_t r = 0; r < n; ++r) {
        double pull = -weight[r];
        for (std::size_t i = 0; i < b.sources; ++i) {
          if (!is_driven(b.source[i])) {
            pull += vector(own_vectors + 2 * b.stride + 2 * i)[r] *
                    static_cast<double>(b.x[b.source[i]]);
            pull += vector(own_vectors + 2 * b.stride + 2 * i + 1)[r] *
                    static_cast<double>(b.v[b.source[i]]);
          }
        }
        constant[r] = constant[n + r] = pull * b.exact[r];
      }
    }
  }

  bool is_driven(std::uint32_t slot) const {
    for (std::size_t i = 0; i < b.driven_count; ++i) {
      if (b.driven[i].slot == slot) {
        return true;
      }
    }
    return false;
  }

  // An observed number after one sample: of the state's own entry, and of A - 1.
  void observe(std::size_t q, std::size_t entry, double by) {
    for (std::size_t c = 0; c < b.columns; ++c) {
      observed[(q * b.columns + c) * row_length] +=
          by * (power[c * b.rows + entry] + (c == entry ? 1.0 : 0.0));
    }
  }

  std::size_t entry_of(const DenseLink& port, std::uint32_t mass) const {
    return facts_of(port.law).zone == Zone::slow ? b.masses + mass : mass;
  }

  void put_first_sample() {
    for (std::size_t i = 0; i < (b.outputs + b.ports) * b.columns * row_length; ++i) {
      observed[i] = 0.0;
    }
    for (std::size_t o = 0; o < b.outputs; ++o) {
      observe(o, b.heard[o], 1.0);
    }
    for (std::size_t p = 0; p < b.ports; ++p) {
      const DenseLink& port = b.port[p];
      if (port.a_moves) {
        observe(b.outputs + p, entry_of(port, port.a), 1.0);
      }
      if (port.b_moves) {
        observe(b.outputs + p, entry_of(port, port.b), -1.0);
      }
    }
    for (std::size_t s = 0; s < b.signals; ++s) {
      const DenseSignal& signal = b.signal[s];
      double* const at = injected + s * driven_frames * b.rows;
      for (std::size_t r = 0; r < b.rows; ++r) {
        at[r] = 0.0;
      }
      const bool is_force = signal.kind == DenseSignal::Kind::force;
      const std::size_t late = signal.kind == DenseSignal::Kind::velocity ? 1 : 0;
      for (std::size_t r = 0; r < b.masses; ++r) {
        const double force = is_force
                                 ? (r == signal.at ? 1.0 : 0.0)
                                 : vector(own_vectors + 2 * b.stride + 2 * signal.at + late)[r];
        at[r] = at[b.masses + r] = force * b.exact[r];
      }
    }
  }

  void double_samples(std::size_t known) {
    for (std::size_t q = 0; q < b.outputs + b.ports; ++q) {
      double* const rows = observed + q * b.columns * row_length;
      for (std::size_t c = 0; c < b.columns; ++c) {
        // Packs that reach beyond the known samples leave what the next doublings write over.
        combine(rows + c * row_length, rows, row_length, power + c * b.rows, std::size_t(1),
                b.columns, 1.0, rows + c * row_length + known, known);
      }
    }
    for (std::size_t s = 0; s < b.signals && known < driven_frames; ++s) {
      double* const states = injected + s * driven_frames * b.rows;
      for (std::size_t n = 0; n < known; ++n) {
        combine(states + n * b.rows, power, b.rows, states + n * b.rows, std::size_t(1), b.columns,
                1.0, states + (n + known) * b.rows, b.rows);
      }
    }
  }

  // (1 + D)^2 - 1 = 2 D + D^2: slow bodies keep their small numbers.
  void square() {
    for (std::size_t c = 0; c < b.columns; ++c) {
      combine(power + c * b.rows, power, b.rows, power + c * b.rows, std::size_t(1), b.columns, 2.0,
              spare + c * b.rows, b.rows);
    }
    double* const swapped = power;
    power = spare;
    spare = swapped;
  }

  void keep_power(std::size_t index) {
    T* const to = b.jump + index * b.columns * b.rows;
    for (std::size_t i = 0; i < b.columns * b.rows; ++i) {
      to[i] = static_cast<T>(power[i]);
    }
  }

  void keep_samples() {
    for (std::size_t o = 0; o < b.outputs; ++o) {
      for (std::size_t c = 0; c < b.columns; ++c) {
        const double* const from = observed + (o * b.columns + c) * row_length;
        T* const to = b.heard_table + c * dense_frames * b.outputs + o;
        for (std::size_t n = 0; n < dense_frames; ++n) {
          to[n * b.outputs] = static_cast<T>(from[n]);
        }
      }
    }
    for (std::size_t i = 0; i < b.ports * b.columns; ++i) {
      const double* const from = observed + (b.outputs * b.columns + i) * row_length;
      for (std::size_t n = 0; n < dense_frames; ++n) {
        b.port_table[i * dense_frames + n] = static_cast<T>(from[n]);
      }
      double most = 0.0;
      for (std::size_t n = 0; n < dense_frames; ++n) {
        const double moved = from[n] < 0.0 ? -from[n] : from[n];
        most = moved > most ? moved : most;
      }
      // A little more, for what is rounded away in a sum of them.
      b.port_bound[i / b.columns * b.rows + i % b.columns] = static_cast<T>(1.001 * most);
    }
  }

  void keep_responses() {
    for (std::size_t i = 0; i < b.signals * driven_frames * b.rows; ++i) {
      const std::size_t row = i % b.rows;
      const std::size_t frame = i / b.rows % driven_frames;
      const std::size_t first = i - row - frame * b.rows;
      b.injection[first + (driven_frames - 1 - frame) * b.rows + row] = static_cast<T>(injected[i]);
    }
    const std::size_t length = driven_frames * b.outputs;
    for (std::size_t s = 0; s < b.signals; ++s) {
      for (std::size_t n = 0; n < driven_frames; ++n) {
        const T* const state = b.injection + ((s + 1) * driven_frames - 1 - n) * b.rows;
        T* const heard = b.heard_response + s * 2 * length + length + n * b.outputs;
        for (std::size_t o = 0; o < b.outputs; ++o) {
          heard[o] = state[b.heard[o]];
        }
        for (std::size_t p = 0; p < b.ports; ++p) {
          const DenseLink& port = b.port[p];
          const T moved = (port.a_moves ? state[entry_of(port, port.a)] : T(0)) -
                          (port.b_moves ? state[entry_of(port, port.b)] : T(0));
          b.port_response[((s * b.ports + p) * 2 + 1) * driven_frames + n] = moved;
        }
      }
    }
  }
};

template <class T>
void build_all(DenseBody<T>& body) {
  Build<T> build{body};
  build.put_first_power();
  build.put_first_sample();
  for (std::size_t i = 0; i < dense_powers; ++i) {
    build.keep_power(i);
    if (i + 1 < dense_powers) {
      build.double_samples(std::size_t(1) << i);
      build.square();
    }
  }
  build.keep_samples();
  build.keep_responses();
}

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA

namespace ressort::kernels {

template <>
void build_dense<Isa::RESSORT_ISA, float>(DenseBody<float>& body) {
  RESSORT_ISA::build_all(body);
}

template <>
void build_dense<Isa::RESSORT_ISA, double>(DenseBody<double>& body) {
  RESSORT_ISA::build_all(body);
}

}  // namespace ressort::kernels
