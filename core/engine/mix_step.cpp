// The loops over the voices of one kernel, compiled for each instruction set.
#include "core/engine/mix.h"

#include "core/engine/lanes.h"

namespace ressort::RESSORT_ISA {
namespace {

template <class V, class T>
V load(const T* from) {
  return *reinterpret_cast<const V*>(from);
}

template <class V, class T>
void peaks_of(const Heard<T>& heard, double bound, std::size_t lane, T* peak) {
  const V most = V{} + static_cast<T>(bound);
  const V beyond = V{} + static_cast<T>(__builtin_huge_val());
  V found{};
  V outside{};
  for (std::size_t row = 0; row < heard.frames * heard.count; ++row) {
    const V y = absolute(load<V>(heard.outputs + row * heard.width + lane));
    found = select(y > found, y, found);
    outside = select(y < most, outside, beyond);
  }
  *reinterpret_cast<V*>(peak + lane) = select(outside > V{}, beyond, found);
}

template <class T>
void find_peaks(const Heard<T>& heard, double bound, T* peak) {
  constexpr std::size_t lanes = vector_bytes(Isa::RESSORT_ISA) / sizeof(T);
  std::size_t lane = 0;
  for (; lane + lanes <= heard.width; lane += lanes) {
    peaks_of<Pack<T, vector_bytes(Isa::RESSORT_ISA)>>(heard, bound, lane, peak);
  }
  for (; lane + 16 / sizeof(T) <= heard.width; lane += 16 / sizeof(T)) {
    peaks_of<Pack<T, 16>>(heard, bound, lane, peak);
  }
  for (; lane < heard.width; ++lane) {
    peaks_of<T>(heard, bound, lane, peak);
  }
}

// Adds to `sum` what whole packs of a row give; returns the first lane beyond them.
template <std::size_t Bytes, class T>
std::size_t add_packs(const T* row, std::size_t lane, std::size_t width, const double* gain,
                      double& sum) {
  using D = Pack<double, Bytes>;
  constexpr std::size_t lanes = Bytes / sizeof(double);
  D packs{};
  for (; lane + lanes <= width; lane += lanes) {
    const D g = load<D>(gain + lane);
    const D y = __builtin_convertvector(load<Pack<T, lanes * sizeof(T)>>(row + lane), D);
    packs += select(g == D{}, D{}, g * y);
  }
  for (std::size_t i = 0; i < lanes; ++i) {
    sum += packs[i];
  }
  return lane;
}

template <class T>
void add_voices(const Heard<T>& heard, const double* gain, double* sum) {
  for (std::size_t i = 0; i < heard.frames * heard.count; ++i) {
    const T* const row = heard.outputs + i * heard.width;
    sum[i] = 0.0;
    std::size_t lane = 0;
    if (heard.width * sizeof(double) >= vector_bytes(Isa::RESSORT_ISA)) {
      lane = add_packs<vector_bytes(Isa::RESSORT_ISA)>(row, 0, heard.width, gain, sum[i]);
    }
    for (; lane < heard.width; ++lane) {
      sum[i] += gain[lane] == 0.0 ? 0.0 : gain[lane] * static_cast<double>(row[lane]);
    }
  }
}

template <class T>
Mixer<T> mixer_of() {
  return {find_peaks<T>, add_voices<T>};
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
