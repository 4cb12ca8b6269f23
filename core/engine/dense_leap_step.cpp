// The leaps of the dense kernel, compiled for each instruction set.
#include "core/engine/dense.h"
#include "core/engine/dense_packs.h"
#include "core/engine/laws.h"

namespace ressort::RESSORT_ISA {
namespace {

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

}  // namespace

template <class T>
std::size_t leap_dense(DenseBody<T>& b, const DenseDrive<T>& drive, std::size_t at,
                       std::size_t count) {
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

template std::size_t leap_dense(DenseBody<float>&, const DenseDrive<float>&, std::size_t,
                                std::size_t);
template std::size_t leap_dense(DenseBody<double>&, const DenseDrive<double>&, std::size_t,
                                std::size_t);

}  // namespace ressort::RESSORT_ISA
