// The recursion of the DC blocker, compiled for each instruction set without fused multiply-adds.
//
// A sample waits for the one before it. Each is therefore computed from the fourth before it and
// from the four newest changes of the input (look-ahead; Parhi and Messerschmitt, 1989):
//   y[n] = c[n] + p c[n-1] + p^2 c[n-2] + p^3 c[n-3] + p^4 y[n-4],  c[n] = x[n] - x[n-1]
#include <algorithm>
#include <cmath>

#include "core/engine/dc_blocker.h"
#include "core/kernels/kernel.h"
#include "core/lanes.h"

namespace ressort::engine::RESSORT_ISA {
namespace {

constexpr std::size_t widest = vector_bytes(Isa::RESSORT_ISA);
constexpr std::size_t back = 4;
using Four = Pack<double, back * sizeof(double)>;

// Returns the part of y[n] that the four newest changes make; c[3] is the newest one.
double sum_of_changes(const double* c, const DcPoles& poles) {
  const auto& p = poles.power;
  return (c[3] + p[1] * c[2]) + (p[2] * c[1] + p[3] * c[0]);
}

// Filters channels that are never 0, all in one loop, because each waits for itself only.
template <std::size_t Count>
void filter_sound(double* const* channels, std::size_t frames, const DcPoles& poles,
                  DcState* const* states) {
  double changes[Count][back - 1 + max_block_frames];
  double sums[Count][max_block_frames + back];
  Four last[Count];
  for (std::size_t c = 0; c < Count; ++c) {
    DcState& state = *states[c];
    const double* const x = channels[c];
    double* const change = changes[c];
    std::copy(state.change.begin(), state.change.end(), change);
    change[back - 1] = x[0] - state.in;
    for (std::size_t n = 1; n < frames; ++n) {
      change[back - 1 + n] = x[n] - x[n - 1];
    }
    for (std::size_t n = 0; n < frames; ++n) {
      sums[c][n] = sum_of_changes(change + n, poles);
    }
    state.in = x[frames - 1];
    std::copy_n(change + frames, back - 1, state.change.begin());
    last[c] = load<Four>(state.out.data());
  }
  std::size_t n = 0;
  for (; n + back <= frames; n += back) {
    for (std::size_t c = 0; c < Count; ++c) {
      last[c] = load<Four>(sums[c] + n) + poles.power[back] * last[c];
      store(channels[c] + n, last[c]);
    }
  }
  for (std::size_t c = 0; c < Count; ++c) {
    double out[2 * back];
    store(out, last[c]);
    for (std::size_t i = n; i < frames; ++i) {
      out[back + i - n] = sums[c][i] + poles.power[back] * out[i - n];
      channels[c][i] = out[back + i - n];
    }
    std::copy_n(out + (frames - n), back, states[c]->out.begin());
  }
}

// Filters a channel that may be silent. After a silent sample, the state is that of a filter whose
// output has always decayed by its own pole.
void filter_with_silence(double* channel, std::size_t frames, const DcPoles& poles,
                         DcState& state) {
  constexpr double nothing = 1e-7;  // -140 dBFS
  if (state.in == 0.0 && state.out[back - 1] == 0.0 && !is_any<widest>(channel, frames, false)) {
    return;
  }
  for (std::size_t n = 0; n < frames; ++n) {
    const double x = channel[n];
    const auto& [c3, c2, c1] = state.change;
    if (x == 0.0 && state.in == 0.0) {
      const double decayed = poles.quick * state.out[back - 1];
      const double y = std::fabs(decayed) < nothing ? 0.0 : decayed;
      state = {.in = x,
               .change = {},
               .out = {y / poles.power[3], y / poles.power[2], y / poles.power[1], y}};
    } else {
      const double c[] = {c3, c2, c1, x - state.in};
      const double y = sum_of_changes(c, poles) + poles.power[back] * state.out[0];
      state = {.in = x,
               .change = {c[1], c[2], c[3]},
               .out = {state.out[1], state.out[2], state.out[3], y}};
    }
    channel[n] = state.out[back - 1];
  }
}

void filter_block(double* const* channels, std::size_t count, std::size_t frames,
                  const DcPoles& poles, DcState* states) {
  double* sounding[2];
  DcState* sounding_states[2];
  std::size_t found = 0;
  for (std::size_t c = 0; c < count; ++c) {
    if (is_any<widest>(channels[c], frames, true)) {
      filter_with_silence(channels[c], frames, poles, states[c]);
    } else {
      sounding[found] = channels[c];
      sounding_states[found++] = &states[c];
    }
  }
  if (found == 2) {
    filter_sound<2>(sounding, frames, poles, sounding_states);
  } else if (found == 1) {
    filter_sound<1>(sounding, frames, poles, sounding_states);
  }
}

void filter(std::span<double* const> channels, std::size_t frames, const DcPoles& poles,
            DcState* states) {
  for (std::size_t c = 0; c < channels.size(); c += 2) {
    const std::size_t count = std::min<std::size_t>(2, channels.size() - c);
    for (std::size_t at = 0; at < frames; at += max_block_frames) {
      double* here[2] = {};
      for (std::size_t i = 0; i < count; ++i) {
        here[i] = channels[c + i] + at;
      }
      filter_block(here, count, std::min(max_block_frames, frames - at), poles, states + c);
    }
  }
}

}  // namespace
}  // namespace ressort::engine::RESSORT_ISA

namespace ressort::engine {

template <>
FilterDc dc_filter<Isa::RESSORT_ISA>() {
  return RESSORT_ISA::filter;
}

}  // namespace ressort::engine
