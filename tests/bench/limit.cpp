#include "tests/bench/limit.h"

#include <algorithm>
#include <chrono>

#include "core/kernels/chains/chains_form.h"
#include "core/kernels/grid/grid_form.h"
#include "core/kernels/modal/modal_form.h"
#include "core/lanes.h"

#ifdef __x86_64__
#define RESSORT_TARGET(levels) __attribute__((target(levels)))
#else
#define RESSORT_TARGET(levels)
#endif

namespace ressort::bench {
namespace {

constexpr std::size_t chains = 12;  // independent chains, which hide the latency
constexpr std::size_t turns = 20'000;

// Inlined into functions for each instruction set.
template <class V>
[[gnu::always_inline]] inline double run(Scalar<V> by, Scalar<V> more) {
  V sum[chains] = {};
  const V factor = V{} + by;
  const V added = V{} + more;
  for (std::size_t turn = 0; turn < turns; ++turn) {
    for (V& one : sum) {
      one = one * factor + added;
    }
  }
  V all{};
  for (const V& one : sum) {
    all += one;
  }
  return static_cast<double>(all[0]);
}

template <class T>
double run_base(T by, T more) {
  return run<Pack<T, 16>>(by, more);
}
template <class T>
RESSORT_TARGET("avx2,fma")
double run_v3(T by, T more) {
  return run<Pack<T, 32>>(by, more);
}
template <class T>
RESSORT_TARGET("avx512f,avx512dq,avx512vl,fma,prefer-vector-width=512")
double run_v4(T by, T more) {
  return run<Pack<T, 64>>(by, more);
}

template <class T>
double fastest(Isa isa) {
  using Clock = std::chrono::steady_clock;
  const auto once = isa == Isa::v4 ? run_v4<T> : isa == Isa::v3 ? run_v3<T> : run_base<T>;
  const double lanes = static_cast<double>(vector_bytes(isa) / sizeof(T));
  double best = 0.0;
  volatile double kept = 0.0;
  for (int i = 0; i < 50; ++i) {
    const auto start = Clock::now();
    kept = kept + once(T(0.5), T(1));
    const std::chrono::duration<double, std::nano> took = Clock::now() - start;
    best = std::max(best, lanes * static_cast<double>(chains * turns) / took.count());
  }
  clear_wide_registers();
  return best;
}

// Per mode: d -= K q + Z d; q += d. Plus one multiply-add for each output place. Most of the time
// no force acts.
std::optional<double> multiply_adds_of(const Modes& form) {
  if (!form.places.empty()) {
    return std::nullopt;
  }
  return form.modes * (3.0 + static_cast<double>(form.outputs.size()));
}

// Per mass: y = K x + Z v, the sum over the offsets, v += w sum, x += v.
std::optional<double> multiply_adds_of(const Grid& form) {
  if (form.segments.empty()) {
    return std::nullopt;
  }
  double sum = 0.0;
  for (const GridSegment& segment : form.segments) {
    sum += segment.count * (5.0 + static_cast<double>(segment.offsets.size()));
  }
  return sum;
}

std::optional<double> multiply_adds_of(const Chains& form) {
  double sum = 0.0;
  for (const Chain& chain : form.chains) {
    sum += chain.count * (chain.is_stiff ? 12.0 : 6.0);
  }
  return sum;
}

}  // namespace

double multiply_adds_per_ns(Isa isa, bool is_double) {
  return is_double ? fastest<double>(isa) : fastest<float>(isa);
}

std::optional<double> multiply_adds(const Program& program) {
  if (const auto* const modes = program.form.get_if<Modes>()) {
    return multiply_adds_of(*modes);
  }
  if (const auto* const grid = program.form.get_if<Grid>()) {
    return multiply_adds_of(*grid);
  }
  const auto* const chains = program.form.get_if<Chains>();
  return chains == nullptr ? std::nullopt : multiply_adds_of(*chains);
}

}  // namespace ressort::bench
