#include "core/engine/dc_blocker.h"

#include <algorithm>

namespace ressort::engine {

DcBlocker::DcBlocker(double rate_hz)
    : poles_{.power = {1.0}, .quick = std::exp(-1.0 / (0.0005 * rate_hz))},
      filter_(with_isa(best_isa(), []<Isa isa>() { return dc_filter<isa>(); })) {
  for (std::size_t i = 1; i < poles_.power.size(); ++i) {
    poles_.power[i] =
        std::exp(-2.0 * std::numbers::pi * corner_hz * static_cast<double>(i) / rate_hz);
  }
}

void DcBlocker::process(std::span<double* const> channels, std::size_t frames, bool has_dc) {
  if (frames == 0) {
    return;
  }
  const std::size_t count = std::min(channels.size(), max_channels);
  const std::span<DcState> states = std::span(states_).first(count);
  if (has_dc || is_filtering_) {
    filter_(channels.first(count), frames, poles_, states.data());
    is_filtering_ = std::any_of(states.begin(), states.end(), [](const DcState& state) {
      return state.in != 0.0 || state.out.back() != 0.0;
    });
    return;
  }
  // The state is that of a filter that has passed the last sample unchanged.
  for (std::size_t c = 0; c < count; ++c) {
    const double last = channels[c][frames - 1];
    states[c] = {.in = last, .change = {}, .out = {}};
    for (std::size_t i = 0; i < states[c].out.size(); ++i) {
      states[c].out[i] = last / poles_.power[states[c].out.size() - 1 - i];
    }
  }
}

}  // namespace ressort::engine
