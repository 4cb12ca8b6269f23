// The strides of the dense kernel, compiled for each instruction set.
#include <utility>

#include "core/kernels/dense/dense.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

// Eight numbers, in as many packs as that takes.
template <class T>
struct Eight {
  static constexpr std::size_t widest = vector_bytes(Isa::RESSORT_ISA);
  static constexpr std::size_t bytes =
      stride_state * sizeof(T) < widest ? stride_state * sizeof(T) : widest;
  static constexpr std::size_t lanes = bytes / sizeof(T);
  static constexpr std::size_t count = stride_state / lanes;
  using V = Pack<T, bytes>;

  static Eight from(const T* numbers) {
    Eight e;
    for (std::size_t i = 0; i < count; ++i) {
      e.pack[i] = load<V>(numbers + i * lanes);
    }
    return e;
  }
  void put(T* to) const {
    for (std::size_t i = 0; i < count; ++i) {
      store<V>(to + i * lanes, pack[i]);
    }
  }
  template <class By>
  [[gnu::always_inline]] void add(const T* column, By by) {
    for (std::size_t i = 0; i < count; ++i) {
      pack[i] += load<V>(column + i * lanes) * by;
    }
  }
  [[gnu::always_inline]] void add(const Eight& more) {
    for (std::size_t i = 0; i < count; ++i) {
      pack[i] += more.pack[i];
    }
  }
  // The k-th number in every lane.
  template <std::size_t k>
  [[gnu::always_inline]] V all() const {
    return [&]<std::size_t... lane>(std::index_sequence<lane...>) {
      return __builtin_shufflevector(pack[k / lanes], pack[k / lanes], (lane * 0 + k % lanes)...);
    }
    (std::make_index_sequence<lanes>());
  }

  V pack[count];
};

// Whether the first numbers lie between bounds; what is no number does not.
template <class T>
[[gnu::always_inline]] inline bool are_between(const T* numbers, const T* low, const T* high) {
  using V = Pack<T, stride_frames * sizeof(T)>;
  const V x = load<V>(numbers);
  const auto inside = (x > load<V>(low)) & (x < load<V>(high));
  return (inside[0] & inside[1] & inside[2] & inside[3]) != 0;
}

// What the port's other end does: frame by frame the force on the mass if that stood at 0, and
// between which places the mass is on the piece.
template <class T>
struct Held {
  Held(const DenseHold<T>& hold, std::size_t frames) {
    pull[0] = hold.force + hold.stiffness * hold.start + hold.damping * hold.start_speed;
    for (std::size_t n = 0; n < frames; ++n) {
      const T x = hold.position != nullptr ? hold.position[n] : hold.start;
      const T v = hold.velocity != nullptr ? hold.velocity[n] : hold.start_speed;
      pull[n + 1] = hold.force + hold.stiffness * x + hold.damping * v;
      low[n] = x + hold.low;
      high[n] = x + hold.high;
    }
  }

  T pull[max_block_frames + 1];
  T low[max_block_frames];
  T high[max_block_frames];
};

// With so many columns, and packs besides the state's. What the next stride waits for is a move
// from lane to lane, half of the columns and an addition; all else has a stride's time.
template <std::size_t Columns, std::size_t Heard, class T>
std::size_t stride(DenseBody<T>& b, const T* table, const DenseHold<T>& hold, T* outputs,
                   std::size_t count) {
  constexpr std::size_t step = (1 + Heard) * stride_state;
  constexpr std::size_t row = stride_state;
  const T* const pulls = table + Columns * step;
  const std::size_t heard = stride_frames * (Heard == 1 ? 1 : b.outputs);
  const Held<T> held(hold, count);
  auto state = Eight<T>::from(b.state);
  std::size_t n = 0;
  for (; n + stride_frames <= count; n += stride_frames) {
    Eight<T> next = state;
    Eight<T> other{};
    Eight<T> motion[2][Heard] = {};
    for (std::size_t i = 0; i < stride_frames; ++i) {
      other.add(pulls + i * step, held.pull[n + i]);
      for (std::size_t h = 0; h < Heard; ++h) {
        motion[0][h].add(pulls + i * step + (1 + h) * row, held.pull[n + i]);
      }
    }
    [&]<std::size_t... k>(std::index_sequence<k...>) __attribute__((always_inline)) {
      const auto add_column = [&]<std::size_t c>() __attribute__((always_inline)) {
        const auto by = state.template all<c>();
        (c % 2 == 0 ? next : other).add(table + c * step, by);
        for (std::size_t h = 0; h < Heard; ++h) {
          motion[c % 2][h].add(table + c * step + (1 + h) * row, by);
        }
      };
      (add_column.template operator()<k>(), ...);
    }
    (std::make_index_sequence<Columns>());
    alignas(widest_bytes) T moved[Heard * row];
    for (std::size_t h = 0; h < Heard; ++h) {
      motion[0][h].add(motion[1][h]);
      motion[0][h].put(moved + h * row);
    }
    if (!are_between(moved, held.low + n, held.high + n)) {
      break;
    }
    for (std::size_t i = 0; i < heard; ++i) {
      outputs[i] = moved[stride_frames + i];
    }
    outputs += heard;
    next.add(other);
    state = next;
  }
  state.put(b.state);
  return n;
}

template <class T>
std::size_t stride_of(DenseBody<T>& b, const T* table, const DenseHold<T>& hold, T* outputs,
                      std::size_t count) {
  const bool is_small = stride_columns(b.columns) == 6;
  if (b.outputs == 1) {
    return is_small ? stride<6, 1>(b, table, hold, outputs, count)
                    : stride<8, 1>(b, table, hold, outputs, count);
  }
  return is_small ? stride<6, 2>(b, table, hold, outputs, count)
                  : stride<8, 2>(b, table, hold, outputs, count);
}

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA

namespace ressort::kernels {

template <>
std::size_t dense_stride<Isa::RESSORT_ISA, float>(DenseBody<float>& body, const float* table,
                                                  const DenseHold<float>& hold, float* outputs,
                                                  std::size_t count) {
  return RESSORT_ISA::stride_of(body, table, hold, outputs, count);
}

template <>
std::size_t dense_stride<Isa::RESSORT_ISA, double>(DenseBody<double>& body, const double* table,
                                                   const DenseHold<double>& hold, double* outputs,
                                                   std::size_t count) {
  return RESSORT_ISA::stride_of(body, table, hold, outputs, count);
}

}  // namespace ressort::kernels
