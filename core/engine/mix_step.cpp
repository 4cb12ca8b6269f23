// The loops over the voices of one kernel, compiled for each instruction set.
#include "core/engine/mix.h"

#include <limits>
#include <utility>

#include "core/kernels/kernel.h"
#include "core/random.h"

namespace ressort::engine::RESSORT_ISA {
namespace {

constexpr std::size_t widest = vector_bytes(Isa::RESSORT_ISA);

// The bit patterns of a pack. Without the sign bit they have the order of the magnitudes, with
// infinity and NaN after all others. Integer comparisons are faster than floating-point ones.
template <class V>
using Bits = decltype(V{} < V{});

template <class V>
Bits<V> magnitude(V y) {
  return reinterpret_cast<Bits<V>>(y) & std::numeric_limits<Scalar<Bits<V>>>::max();
}

// Loads the `count` numbers that remain after whole packs, and fills up with zeros.
template <class V>
[[gnu::noinline]] V load_some(const Scalar<V>* from, std::size_t count) {
  V pack{};
  for (std::size_t i = 0; i < count; ++i) {
    pack[i] = from[i];
  }
  return pack;
}

// --- inputs -------------------------------------------------------------------------------------

bool is_silent(const double* samples, std::size_t frames) {
  return !is_any<widest>(samples, frames, false);
}

template <std::size_t Step, class T>
void fill_packs(const T* row, std::size_t frames, T* value) {
  const auto pack = load<Pack<T, Step * sizeof(T)>>(row);
  for (std::size_t n = 0; n < frames; ++n) {
    store(value + n * Step, pack);
  }
}

template <class T>
void fill_rows(const T* row, std::size_t step, std::size_t frames, T* value) {
  if (step == 1) {
    for (std::size_t n = 0; n < frames; ++n) {
      value[n] = *row;
    }
    return;
  }
  if (step == 2 || step == 4) {
    return step == 2 ? fill_packs<2>(row, frames, value) : fill_packs<4>(row, frames, value);
  }
  for (std::size_t n = 0; n < frames; ++n) {
    for (std::size_t i = 0; i < step; ++i) {
      value[n * step + i] = row[i];
    }
  }
}

// Several rows together fill whole packs, whatever their length.
template <class T>
void scale_rows(const T* rows, std::size_t step, std::size_t frames, T* value) {
  using V = Pack<T, rows_together * sizeof(T)>;
  for (; frames >= rows_together; frames -= rows_together, value += rows_together * step) {
    for (std::size_t i = 0; i < step; ++i) {
      store(value + i * rows_together,
            load<V>(value + i * rows_together) * load<V>(rows + i * rows_together));
    }
  }
  for (std::size_t i = 0; i < frames * step; ++i) {
    value[i] *= rows[i];
  }
}

// rows[n * step + lane] = (rest or rows[n * step + lane]) + added(n)
template <class T, class Added>
[[gnu::always_inline]] inline void add_rows(Added&& added, const T* rest, std::size_t frames,
                                            std::size_t step, std::size_t width, T* rows) {
  for (std::size_t n = 0; n < frames; ++n) {
    const T more = static_cast<T>(added(n));
    for (std::size_t at = n * step; at < n * step + width; ++at) {
      rows[at] = (rest != nullptr ? *rest : rows[at]) + more;
    }
  }
}

template <class T, class Added>
[[gnu::always_inline]] inline void add_to(const AudioInput<T>& input, Added&& added, T rest,
                                          T* rows) {
  const std::size_t frames = input.frames;
  if (!input.rests) {
    add_rows<T>(added, nullptr, frames, input.step, input.width, rows);
  } else if (input.step == 1) {  // the usual case, compiled with constants
    add_rows<T>(added, &rest, frames, 1, 1, rows);
  } else {
    add_rows<T>(added, &rest, frames, input.step, input.width, rows);
  }
}

template <class T>
void add_one_sound(const AudioInput<T>& input) {
  double here[max_block_frames + 1];
  here[0] = input.before[0];
  for (std::size_t n = 0; n < input.frames; ++n) {
    here[n + 1] = input.scale[0] * input.samples[0][n];
  }
  add_to(
      input, [&](std::size_t n) { return here[n + 1]; }, input.rest[0], input.value);
  if (input.velocity != nullptr) {
    add_to(
        input, [&](std::size_t n) { return here[n + 1] - here[n]; }, T(0), input.velocity);
  }
}

// Adds several channels in one pass, for kernels with one lane.
template <std::size_t Sounds, class T>
void add_sounds(const AudioInput<T>& input) {
  using D = Pack<double, Sounds * sizeof(double)>;
  using V = Pack<T, Sounds * sizeof(T)>;
  const bool rests = input.rests;
  const std::size_t step = input.step;
  const D scale = load<D>(input.scale.data());
  D before = load<D>(input.before.data());
  T* value = input.value;
  T* velocity = input.velocity;
  const auto add = [&](T* row, V rest, D added) {
    const V more = __builtin_convertvector(added, V);
    store<V>(row, (rests ? rest : load<V>(row)) + more);
  };
  const V rest = load<V>(input.rest.data());
  for (std::size_t n = 0; n < input.frames; ++n, value += step) {
    D here;
    for (std::size_t i = 0; i < Sounds; ++i) {
      here[i] = input.samples[i][n];
    }
    here *= scale;
    add(value, rest, here);
    if (velocity != nullptr) {
      add(velocity, V{}, here - before);
      velocity += step;
    }
    before = here;
  }
}

template <class T>
void add_audio(const AudioInput<T>& input) {
  if (input.count == 1) {
    add_one_sound(input);
  } else if (input.count == 2) {
    add_sounds<2>(input);
  } else {
    add_sounds<4>(input);
  }
}

// --- peaks --------------------------------------------------------------------------------------

template <class V>
Bits<V> larger(Bits<V> a, Bits<V> b) {
  return a > b ? a : b;
}

// Returns the largest magnitudes in the packs at y, y + step and so on. Four independent maxima
// keep the pipeline full.
template <class V, class T>
Bits<V> largest_of(const T* y, std::size_t count, std::size_t step) {
  constexpr std::size_t together = 4;
  Bits<V> found[together] = {};
  std::size_t i = 0;
  for (; i + together <= count; i += together) {
    for (std::size_t k = 0; k < together; ++k) {
      found[k] = larger<V>(found[k], magnitude(load<V>(y + (i + k) * step)));
    }
  }
  for (; i < count; ++i) {
    found[0] = larger<V>(found[0], magnitude(load<V>(y + i * step)));
  }
  return larger<V>(larger<V>(found[0], found[1]), larger<V>(found[2], found[3]));
}

template <class V>
V within(Bits<V> largest, double bound) {
  const V peak = reinterpret_cast<V>(largest);
  const V beyond = V{} + static_cast<Scalar<V>>(__builtin_huge_val());
  return select(peak < V{} + static_cast<Scalar<V>>(bound), peak, beyond);
}

// Returns the peak of a kernel with one lane, whose samples are contiguous.
template <class T>
T peak_of_one(const T* y, std::size_t count, double bound) {
  using V = Pack<T, widest>;
  constexpr std::size_t lanes = widest / sizeof(T);
  const std::size_t whole = count - count % lanes;
  Bits<V> largest = largest_of<V>(y, whole / lanes, lanes);
  if (whole < count) {
    largest = larger<V>(largest, magnitude(load_some<V>(y + whole, count - whole)));
  }
  const auto most = folded(largest, [](auto a, auto b) { return a > b ? a : b; });
  using Narrow = Pack<T, 16>;
  return within<Narrow>(Bits<Narrow>{} + most, bound)[0];
}

template <class T>
void find_peaks(const Heard<T>& heard, double bound, T* peak) {
  const std::size_t rows = heard.frames * heard.count;
  if (heard.width == 1) {
    *peak = peak_of_one(heard.outputs, rows, bound);
    return;
  }
  std::size_t lane = 0;
  const auto find = [&]<class V>(V) {
    const Bits<V> largest = largest_of<V>(heard.outputs + lane, rows, heard.width);
    store<V>(peak + lane, within<V>(largest, bound));
    lane += sizeof(V) / sizeof(T);
  };
  while (lane + widest / sizeof(T) <= heard.lanes) {
    find(Pack<T, widest>{});
  }
  while (lane < heard.lanes) {
    find(Pack<T, 16>{});
  }
}

// --- outputs ------------------------------------------------------------------------------------

// Returns the even or the odd blocks of `Block` numbers of two packs.
template <std::size_t Block, std::size_t Odd, class V, std::size_t... I>
[[gnu::always_inline]] inline V blocks_of(V a, V b, std::index_sequence<I...>) {
  constexpr std::size_t lanes = sizeof...(I);
  return __builtin_shufflevector(
      a, b, (I / Block % 2 * lanes + (I / Block / 2 * 2 + Odd) * Block + I % Block)...);
}

// Sums each pack of a square matrix of packs by a transposing tree of shuffles and additions.
template <std::size_t Block = 1, class V>
[[gnu::always_inline]] inline V sums_of(V* packs) {
  constexpr std::size_t lanes = sizeof(V) / sizeof(Scalar<V>);
  constexpr std::make_index_sequence<lanes> all;
  for (std::size_t i = 0; i < lanes / Block / 2; ++i) {
    packs[i] = blocks_of<Block, 0>(packs[2 * i], packs[2 * i + 1], all) +
               blocks_of<Block, 1>(packs[2 * i], packs[2 * i + 1], all);
  }
  if constexpr (2 * Block < lanes) {
    return sums_of<2 * Block>(packs);
  } else {
    return packs[0];
  }
}

// channel[n] += sum of gain[lane] * rows[n * step + lane], for as many frames at once as a pack has
// numbers. Each gain is loaded once for all of these frames, and their sums are folded together.
// Float outputs are summed in float, which is as exact as the lanes themselves.
template <class V, class T>
void add_lanes(const T* rows, std::size_t step, std::size_t used, const T* gain, std::size_t frames,
               double* channel) {
  constexpr std::size_t lanes = sizeof(V) / sizeof(T);
  const auto add = [&](std::size_t first, std::size_t count) __attribute__((always_inline)) {
    V packs[lanes] = {};
    for (std::size_t lane = 0; lane < used; lane += lanes) {
      const V g = load<V>(gain + lane);
      const auto is_heard = g != V{};
      for (std::size_t n = 0; n < count; ++n) {
        const V y = load<V>(rows + (first + n) * step + lane);
        packs[n] += g * select(is_heard, y, V{});
      }
    }
    const V sums = sums_of(packs);
    for (std::size_t n = 0; n < count; ++n) {
      channel[first + n] += static_cast<double>(sums[n]);
    }
  };
  const std::size_t whole = frames - frames % lanes;
  for (std::size_t first = 0; first < whole; first += lanes) {
    add(first, lanes);
  }
  if (whole < frames) {
    add(whole, frames - whole);
  }
}

// Mixes with the widest packs that the lanes fill.
template <std::size_t Bytes = widest, class T>
void add_lanes_of(const T* rows, std::size_t step, std::size_t used, const T* gain,
                  std::size_t frames, double* channel) {
  if constexpr (Bytes > 16) {
    if (used % (Bytes / sizeof(T)) != 0) {
      return add_lanes_of<Bytes / 2>(rows, step, used, gain, frames, channel);
    }
  }
  add_lanes<Pack<T, Bytes>>(rows, step, used, gain, frames, channel);
}

// Mixes a kernel with one lane. Steps of 1 and 2 (one or two outputs) are the usual cases, compiled
// with constants.
template <std::size_t Step, class T>
void add_one(const T* y, std::size_t frames, double gain, double* __restrict channel) {
  for (std::size_t n = 0; n < frames; ++n) {
    channel[n] += gain * static_cast<double>(y[n * Step]);
  }
}

template <class T>
void add_one(const T* y, std::size_t frames, std::size_t step, double gain, double* channel) {
  if (step == 1) {
    return add_one<1>(y, frames, gain, channel);
  }
  if (step == 2) {
    return add_one<2>(y, frames, gain, channel);
  }
  for (std::size_t n = 0; n < frames; ++n) {
    channel[n] += gain * static_cast<double>(y[n * step]);
  }
}

template <class T>
void add_voices(const Heard<T>& heard, const T* gain, double* const* channels) {
  const std::size_t step = heard.count * heard.width;
  for (std::size_t output = 0; output < heard.count; ++output) {
    const T* const y = heard.outputs + output * heard.width;
    double* const channel = channels[output];
    if (heard.width > 1) {
      add_lanes_of(y, step, heard.lanes, gain, heard.frames, channel);
    } else if (*gain != T(0)) {
      add_one(y, heard.frames, step, static_cast<double>(*gain), channel);
    }
  }
}

template <class T>
bool mix(const Heard<T>& heard, double bound, const T* gain, double* const* channels, T* peak) {
  find_peaks(heard, bound, peak);
  for (std::size_t lane = 0; lane < heard.lanes; ++lane) {
    if (gain[lane] != T(0) && !(static_cast<double>(peak[lane]) < bound)) {
      return false;
    }
  }
  add_voices(heard, gain, channels);
  return true;
}

void make_noise(double* samples, std::size_t frames, std::uint64_t state, std::uint64_t step) {
  for (std::size_t n = 0; n < frames; ++n, state += step * splitmix_step) {
    std::uint64_t here = state;
    samples[n] *= 0x1p-63 * static_cast<double>(static_cast<std::int64_t>(splitmix64(here)));
  }
}

template <class T>
Mixer<T> mixer_of() {
  return {is_silent, make_noise, fill_rows<T>, scale_rows<T>, add_audio<T>, add_voices<T>, mix<T>};
}

}  // namespace
}  // namespace ressort::engine::RESSORT_ISA

namespace ressort::engine {

template <>
Mixer<float> make_mixer<Isa::RESSORT_ISA, float>() {
  return RESSORT_ISA::mixer_of<float>();
}

template <>
Mixer<double> make_mixer<Isa::RESSORT_ISA, double>() {
  return RESSORT_ISA::mixer_of<double>();
}

}  // namespace ressort::engine
