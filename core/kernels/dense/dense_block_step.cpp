// The block steps of the dense kernel, compiled for each instruction set.
#include "core/kernels/dense/dense.h"
#include "core/laws/laws.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

constexpr std::size_t widest = vector_bytes(Isa::RESSORT_ISA);

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

// out = table * factor for Count packs of rows, the table being [column][step]. Few packs are
// summed in two chains: otherwise each column would wait for the one before.
template <class T, std::size_t Count>
void expand_some(const T* table, std::size_t step, std::size_t columns, const T* factor, T* out) {
  using V = Wide<T>;
  constexpr std::size_t chains = Count > 4 ? 1 : 2;
  V sum[chains][Count] = {};
  const T* const end = factor + columns;
  if (columns % chains == 1) {
    for (std::size_t i = 0; i < Count; ++i) {
      sum[0][i] = load<V>(table + i * wide_lanes<T>) * *factor;
    }
    ++factor;
    table += step;
  }
  for (; factor != end; factor += chains, table += chains * step) {
    for (std::size_t chain = 0; chain < chains; ++chain) {
      for (std::size_t i = 0; i < Count; ++i) {
        sum[chain][i] += load<V>(table + chain * step + i * wide_lanes<T>) * factor[chain];
      }
    }
  }
  for (std::size_t i = 0; i < Count; ++i) {
    store<V>(out + i * wide_lanes<T>, chains == 1 ? sum[0][i] : sum[0][i] + sum[chains - 1][i]);
  }
}

template <class T>
void expand(const T* table, std::size_t step, std::size_t rows, std::size_t columns,
            const T* factor, T* out) {
  in_packs<T, 8>(rows, [&]<std::size_t Count>(std::size_t row) {
    expand_some<T, Count>(table + row, step, columns, factor, out + row);
  });
}

// out += what the signal u[0..count) does to `rows` numbers, `each` numbers a frame; it begins at
// the response's middle.
template <class T>
void respond(const T* middle, const T* u, std::size_t count, std::size_t rows, std::size_t each,
             T* out) {
  using V = Wide<T>;
  in_packs<T, 4>(rows, [&]<std::size_t Count>(std::size_t row) {
    V sum[2][Count] = {};
    const auto add = [&](V(&to)[Count], std::size_t m) {
      for (std::size_t i = 0; i < Count; ++i) {
        to[i] += load<V>(middle - m * each + row + i * wide_lanes<T>) * u[m];
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
  return folded(pack, [](auto a, auto b) { return select(a < b, a, b); });
}

// How far d (or a velocity) is from where the law acts, on both sides or beyond; it acts below 0.
template <bool on_both_sides, class V, class T>
V distance(V d, T zone) {
  return (on_both_sides ? absolute(d) : V{} - d) - zone;
}

// What one block step works on.
template <class T>
struct BlockStep {
  using V = Wide<T>;
  static constexpr std::size_t lanes = wide_lanes<T>;

  DenseBody<T>& b;
  const DenseDrive<T>& drive;
  std::size_t at;
  std::size_t count;
  T* heard = b.scratch;
  T* motion = heard + dense_frames * b.outputs;
  T* next = motion + dense_frames;
  T* shifted = next + b.rows;
  bool is_driven = false;  // some signal sounds

  // Whole packs that hold so many numbers.
  static std::size_t padded(std::size_t numbers) { return (numbers + lanes - 1) / lanes * lanes; }

  bool is_silent(const T* u) const {
    V least{};
    std::size_t n = 0;
    for (; n + lanes <= count; n += lanes) {
      least = select(load<V>(u + n) != V{}, V{} - 1, least);
    }
    while (n < count && u[n] == T(0)) {
      ++n;
    }
    return n == count && !(least_of<T>(least) < T(0));
  }

  // The signals over the block step, or nothing where one is silent.
  void listen() {
    for (std::size_t s = 0; s < b.signals; ++s) {
      const DenseSignal& slot = b.signal[s];
      const bool is_velocity = slot.kind == DenseSignal::Kind::velocity;
      const T* const input =
          (is_velocity ? drive.velocity : drive.value) + slot.input * max_block_frames + at;
      const T* u = input;
      if (slot.kind != DenseSignal::Kind::force) {
        T* const late = shifted + s * dense_frames;
        const std::uint32_t end = b.source[slot.at];
        late[0] = is_velocity ? b.v[end] : b.x[end];
        for (std::size_t n = 1; n < count; ++n) {
          late[n] = input[n - 1];
        }
        u = late;
      }
      b.sounding[s] = is_silent(u) ? nullptr : u;
      is_driven |= b.sounding[s] != nullptr;
    }
    if (is_driven && count > driven_frames) {
      count = driven_frames;
    }
  }

  // Where an end that is no mass goes: it stays, or a hand moves it.
  struct End {
    T still = T(0);
    const T* moved = nullptr;  // [frame]
  };
  End end_of(bool is_bow, std::uint32_t slot, std::uint32_t input, bool is_mass) const {
    if (is_mass) {
      return {};
    }
    if (input == no_input) {
      return {is_bow ? b.v[slot] : b.x[slot]};
    }
    return {T(0), (is_bow ? drive.velocity : drive.value) + input * max_block_frames + at};
  }

  struct Range {
    T low;
    T high;
  };
  Range range_of(const End& end) const {
    if (end.moved == nullptr) {
      return {end.still, end.still};
    }
    V low = V{} + end.moved[0];
    V high = low;
    std::size_t n = 0;
    for (; n + lanes <= count; n += lanes) {
      const V here = load<V>(end.moved + n);
      low = select(here < low, here, low);
      high = select(high < here, here, high);
    }
    Range range{least_of<T>(low), -least_of<T>(-high)};
    for (; n < count; ++n) {
      range.low = end.moved[n] < range.low ? end.moved[n] : range.low;
      range.high = range.high < end.moved[n] ? end.moved[n] : range.high;
    }
    return range;
  }

  // The first frame in which the port's law acts, or count.
  std::size_t first_touch(std::size_t p) {
    const DenseLink& port = b.port[p];
    const LawFacts& law = facts_of(port.law);
    const T reach = b.ramps.value[port.coefficients[law.slot(Role::reach)]];
    return law.zone == Zone::below ? first_touch<false>(p, reach) : first_touch<true>(p, reach);
  }
  template <bool on_both_sides>
  std::size_t first_touch(std::size_t p, T zone) {
    const DenseLink& port = b.port[p];
    const bool is_bow = facts_of(port.law).zone == Zone::slow;
    const End a = end_of(is_bow, port.a, port.input_a, port.a_moves);
    const End c = end_of(is_bow, port.b, port.input_b, port.b_moves);
    if (!is_driven) {
      const Range of_a = range_of(a);
      const Range of_c = range_of(c);
      const T most = farthest(p);
      if (of_a.high - of_c.low + most < -zone ||
          (on_both_sides && of_a.low - of_c.high - most > zone)) {
        return count;
      }
    }
    expand(b.port_table + p * b.columns * dense_frames, dense_frames, padded(count), b.columns,
           b.state, motion);
    for (std::size_t s = 0; s < b.signals; ++s) {
      if (const T* const u = b.sounding[s]) {
        respond(b.port_response + ((s * b.ports + p) * 2 + 1) * driven_frames, u, count,
                padded(count), std::size_t(1), motion);
      }
    }
    return first_within<on_both_sides>(a, c, zone);
  }

  // No less than the port's masses move from 0 in a block step without forces.
  T farthest(std::size_t p) const {
    V sum{};
    for (std::size_t i = 0; i < b.rows; i += lanes) {
      sum += absolute(load<V>(b.state + i)) * load<V>(b.port_bound + p * b.rows + i);
    }
    return folded(sum, [](auto a, auto b) { return a + b; });
  }

  // The first frame in which `motion`, with the ends a and c, is within the zone.
  template <bool on_both_sides>
  std::size_t first_within(const End& a, const End& c, T zone) {
    const T still = a.still - c.still;
    const auto distance_at = [&]<class N>(std::size_t n) {
      N d = load<N>(motion + n) + still;
      if (a.moved != nullptr) {
        d += load<N>(a.moved + n);
      }
      if (c.moved != nullptr) {
        d -= load<N>(c.moved + n);
      }
      return distance<on_both_sides>(d, zone);
    };
    const std::size_t whole = count / lanes * lanes;
    V least{};
    for (std::size_t n = 0; n < whole; n += lanes) {
      const V here = distance_at.template operator()<V>(n);
      least = select(here < least, here, least);
    }
    std::size_t n = least_of<T>(least) < T(0) ? 0 : whole;
    while (n < count && !(distance_at.template operator()<T>(n) < T(0))) {
      ++n;
    }
    return n;
  }

  void hear() {
    const std::size_t length = count * b.outputs;
    const bool is_whole = length % lanes == 0;
    T* const to = drive.outputs + at * b.outputs;
    T* const out = is_whole ? to : heard;
    expand(b.heard_table, dense_frames * b.outputs, padded(length), b.columns, b.state, out);
    const std::size_t driven = driven_frames * b.outputs;
    for (std::size_t s = 0; s < b.signals; ++s) {
      if (const T* const u = b.sounding[s]) {
        respond(b.heard_response + (s * 2 + 1) * driven, u, count, padded(length), b.outputs, out);
      }
    }
    for (std::size_t i = 0; i < length && !is_whole; ++i) {
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
        expand(b.jump + power * b.columns * b.rows, b.rows, b.rows, b.columns, b.state, next);
        add_next();
      }
    }
    for (std::size_t s = 0; s < b.signals; ++s) {
      if (const T* const u = b.sounding[s]) {
        const T* const late = b.injection + ((s + 1) * driven_frames - count) * b.rows;
        expand(late, b.rows, b.rows, count, u, next);
        add_next();
      }
    }
    for (std::size_t i = 0; i < b.driven_count; ++i) {
      const std::size_t last = b.driven[i].input * max_block_frames + at + count - 1;
      b.x[b.driven[i].slot] = drive.value[last];
      b.v[b.driven[i].slot] = drive.velocity[last];
    }
  }
};

template <class T>
std::size_t block_step(DenseBody<T>& b, const DenseDrive<T>& drive, std::size_t at,
                       std::size_t count) {
  BlockStep<T> l{b, drive, at, count};
  l.listen();
  for (std::size_t p = 0; p < b.ports; ++p) {
    const std::size_t free = l.first_touch(p);
    b.touches |= free < l.count;
    l.count = free;
  }
  if (l.count > 0) {
    l.hear();
    l.jump();
  }
  return l.count;
}

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA

namespace ressort::kernels {

template <>
std::size_t dense_block_step<Isa::RESSORT_ISA, float>(DenseBody<float>& body,
                                                      const DenseDrive<float>& drive,
                                                      std::size_t at, std::size_t count) {
  return RESSORT_ISA::block_step(body, drive, at, count);
}

template <>
std::size_t dense_block_step<Isa::RESSORT_ISA, double>(DenseBody<double>& body,
                                                       const DenseDrive<double>& drive,
                                                       std::size_t at, std::size_t count) {
  return RESSORT_ISA::block_step(body, drive, at, count);
}

}  // namespace ressort::kernels
