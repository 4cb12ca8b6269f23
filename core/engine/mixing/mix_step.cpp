// The loops over the voices of one kernel, compiled for each instruction set.
#include "core/engine/mixing/mix.h"

#include "core/kernels/kernel.h"

namespace ressort::RESSORT_ISA {
namespace {

constexpr std::size_t widest = vector_bytes(Isa::RESSORT_ISA);

template <std::size_t Bytes>
double sum_of(Pack<double, Bytes> pack) {
  if constexpr (Bytes == 16) {
    return pack[0] + pack[1];
  } else {
    Pack<double, Bytes / 2> halves[2];
    store(reinterpret_cast<double*>(halves), pack);
    return sum_of<Bytes / 2>(halves[0] + halves[1]);
  }
}

// --- what goes in -------------------------------------------------------------------------------

bool is_silent(const double* samples, std::size_t frames) {
  using V = Pack<double, widest>;
  constexpr std::size_t lanes = widest / sizeof(double);
  auto sounds = V{} != V{};
  std::size_t n = 0;
  for (; n + lanes <= frames; n += lanes) {
    sounds |= load<V>(samples + n) != V{};
  }
  bool any = false;
  for (std::size_t i = 0; i < lanes; ++i) {
    any |= sounds[i] != 0;
  }
  for (; n < frames; ++n) {
    any |= samples[n] != 0.0;
  }
  return !any;
}

template <class T>
void fill_rows(const T* row, std::size_t step, std::size_t frames, T* value) {
  if (step == 1) {
    for (std::size_t n = 0; n < frames; ++n) {
      value[n] = *row;
    }
    return;
  }
  for (std::size_t n = 0; n < frames; ++n) {
    for (std::size_t i = 0; i < step; ++i) {
      value[n * step + i] = row[i];
    }
  }
}

// rows[n * step + lane] = kept * rows[n * step + lane] + added[n]
template <class T>
[[gnu::always_inline]] inline void add_rows(const double* added, T kept, std::size_t frames,
                                            std::size_t step, std::size_t width, T* rows) {
  for (std::size_t n = 0; n < frames; ++n) {
    const T more = static_cast<T>(added[n]);
    for (std::size_t at = n * step; at < n * step + width; ++at) {
      rows[at] = kept * rows[at] + more;
    }
  }
}

template <class T>
[[gnu::always_inline]] inline void add_to(const AudioInput<T>& input, const double* added,
                                          T* rows) {
  const T kept = input.replaces ? T(0) : T(1);
  if (input.step == 1) {  // one voice and one input: the usual case, and the compiler is to know it
    add_rows(added, kept, input.frames, 1, 1, rows);
  } else {
    add_rows(added, kept, input.frames, input.step, input.width, rows);
  }
}

template <class T>
void add_audio(const AudioInput<T>& input) {
  double here[max_block_frames + 1];
  here[0] = input.before;
  for (std::size_t n = 0; n < input.frames; ++n) {
    here[n + 1] = input.scale * input.samples[n];
  }
  add_to(input, here + 1, input.value);
  if (input.velocity != nullptr) {
    double change[max_block_frames];
    for (std::size_t n = 0; n < input.frames; ++n) {
      change[n] = here[n + 1] - here[n];
    }
    add_to(input, change, input.velocity);
  }
}

// --- peaks --------------------------------------------------------------------------------------

template <class V, class T>
void peaks_of(const T* y, std::size_t count, std::size_t step, double bound, T* peak) {
  const V most = V{} + static_cast<T>(bound);
  const V beyond = V{} + static_cast<T>(__builtin_huge_val());
  V found{};
  V outside{};
  for (std::size_t i = 0; i < count; ++i) {
    const V here = absolute(load<V>(y + i * step));
    found = select(here > found, here, found);
    outside = select(here < most, outside, beyond);
  }
  store(peak, select(outside > V{}, beyond, found));
}

// One lane: its samples lie one after the other.
template <class T>
T peak_of_one(const T* y, std::size_t count, double bound) {
  using V = Pack<T, widest>;
  constexpr std::size_t lanes = widest / sizeof(T);
  const std::size_t whole = count - count % lanes;
  T peaks[lanes + 1] = {};
  peaks_of<V>(y, whole / lanes, lanes, bound, peaks);
  peaks_of<T>(y + whole, count - whole, 1, bound, peaks + lanes);
  T most = peaks[0];
  for (const T peak : peaks) {
    most = peak > most ? peak : most;
  }
  return most;
}

template <class T>
void find_peaks(const Heard<T>& heard, double bound, T* peak) {
  constexpr std::size_t lanes = widest / sizeof(T);
  const std::size_t rows = heard.frames * heard.count;
  if (heard.width == 1) {
    *peak = peak_of_one(heard.outputs, rows, bound);
    return;
  }
  std::size_t lane = 0;
  for (; lane + lanes <= heard.width; lane += lanes) {
    peaks_of<Pack<T, widest>>(heard.outputs + lane, rows, heard.width, bound, peak + lane);
  }
  for (; lane + 16 / sizeof(T) <= heard.width; lane += 16 / sizeof(T)) {
    peaks_of<Pack<T, 16>>(heard.outputs + lane, rows, heard.width, bound, peak + lane);
  }
  for (; lane < heard.width; ++lane) {
    peaks_of<T>(heard.outputs + lane, rows, heard.width, bound, peak + lane);
  }
}

// --- what comes out -----------------------------------------------------------------------------

template <class T>
double sum_of_lanes(const T* row, std::size_t width, const double* gain) {
  using D = Pack<double, widest>;
  constexpr std::size_t lanes = widest / sizeof(double);
  D packs{};
  std::size_t lane = 0;
  for (; lane + lanes <= width; lane += lanes) {
    const D g = load<D>(gain + lane);
    const D y = __builtin_convertvector(load<Pack<T, lanes * sizeof(T)>>(row + lane), D);
    packs += select(g == D{}, D{}, g * y);
  }
  double sum = sum_of<widest>(packs);
  for (; lane < width; ++lane) {
    sum += gain[lane] == 0.0 ? 0.0 : gain[lane] * static_cast<double>(row[lane]);
  }
  return sum;
}

template <class T>
[[gnu::always_inline]] inline void add_one(const T* y, std::size_t frames, std::size_t step,
                                           double gain, double* channel) {
  for (std::size_t n = 0; n < frames; ++n) {
    channel[n] += gain * static_cast<double>(y[n * step]);
  }
}

template <class T>
void add_voices(const Heard<T>& heard, const double* gain, double* const* channels) {
  if (heard.width == 1 && *gain == 0.0) {
    return;
  }
  for (std::size_t output = 0; output < heard.count; ++output) {
    const T* const y = heard.outputs + output * heard.width;
    double* const channel = channels[output];
    if (heard.width > 1) {
      for (std::size_t n = 0; n < heard.frames; ++n) {
        channel[n] += sum_of_lanes(y + n * heard.count * heard.width, heard.width, gain);
      }
    } else if (heard.count > 1) {
      add_one(y, heard.frames, heard.count, *gain, channel);
    } else {  // the usual case, and the compiler is to know it
      add_one(y, heard.frames, 1, *gain, channel);
    }
  }
}

template <class T>
Mixer<T> mixer_of() {
  return {is_silent, fill_rows<T>, add_audio<T>, find_peaks<T>, add_voices<T>};
}

}  // namespace
}  // namespace ressort::RESSORT_ISA

namespace ressort {

template <>
Mixer<float> make_mixer<Isa::RESSORT_ISA, float>() {
  return RESSORT_ISA::mixer_of<float>();
}

template <>
Mixer<double> make_mixer<Isa::RESSORT_ISA, double>() {
  return RESSORT_ISA::mixer_of<double>();
}

}  // namespace ressort
