#include "core/engine/limiter.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>

namespace ressort::engine {
namespace {

constexpr double release_s = 0.08;

// Returns whether all samples are numbers and within the ceiling.
bool are_below(std::span<double* const> channels, std::size_t frames, double ceiling) {
  return std::all_of(channels.begin(), channels.end(), [&](const double* channel) {
    std::int64_t beyond = 0;  // as wide as a sample, so that the loop is vectorised
    for (std::size_t n = 0; n < frames; ++n) {
      beyond += !(std::fabs(channel[n]) <= ceiling);
    }
    return beyond == 0;
  });
}

}  // namespace

Limiter::Limiter(double rate_hz) : release_(1.0 - std::exp(-1.0 / (release_s * rate_hz))) {
  wanted_.fill(1.0);
  smoothed_.fill(1.0);
}

void Limiter::process(std::span<double* const> channels, std::size_t frames) {
  const bool is_open = calm_ > lookahead_frames && released_ == 1.0 && gain_ == 1.0;
  if (is_open && are_below(channels, frames, ceiling)) {
    delay(channels, frames);
  } else {
    limit(channels, frames);
  }
}

// Delays the channels at gain 1. No sample, delayed or new, needs another gain.
void Limiter::delay(std::span<double* const> channels, std::size_t frames) {
  for (std::size_t n = 0; n < frames;) {
    const std::size_t count = std::min(frames - n, lookahead_frames - at_);
    for (std::size_t c = 0; c < channels.size(); ++c) {
      std::swap_ranges(channels[c] + n, channels[c] + n + count, delayed_[c].begin() + at_);
    }
    at_ = (at_ + count) % lookahead_frames;
    n += count;
  }
  calm_ += frames;
}

// A sample leaves after lookahead_frames. The gain at that moment is the mean of the last
// lookahead_frames values of `released_`. Each of them is at most the gain that the sample needs,
// because `released_` never exceeds the least gain wanted by any delayed sample. The gain therefore
// reaches the peak's value exactly when the peak leaves, by a linear ramp.
void Limiter::limit(std::span<double* const> channels, std::size_t frames) {
  constexpr double span = static_cast<double>(lookahead_frames);
  for (std::size_t n = 0; n < frames; ++n) {
    double peak = 0.0;
    for (double* const channel : channels) {
      if (!std::isfinite(channel[n])) {
        channel[n] = 0.0;
      }
      peak = std::max(peak, std::fabs(channel[n]));
    }
    const double wanted = peak > ceiling ? ceiling / peak : 1.0;
    calm_ = peak > ceiling ? 0 : calm_ + 1;
    if (calm_ <= lookahead_frames || released_ < 1.0) {
      // wanted_[at_] belongs to the sample that leaves now, and it still counts.
      const double least = std::min(wanted, *std::min_element(wanted_.begin(), wanted_.end()));
      released_ = std::min(least, released_ + (1.0 - released_) * release_);
      if (released_ > 0.99999 && least == 1.0) {
        released_ = 1.0;
        calm_ = lookahead_frames + 1;
      }
    }
    wanted_[at_] = wanted;
    if (released_ < 1.0 || gain_ < 1.0) {
      smoothed_[at_] = released_;
      // The sum is recomputed each time. A running sum would accumulate rounding errors.
      gain_ = std::accumulate(smoothed_.begin(), smoothed_.end(), 0.0) / span;
    }
    for (std::size_t c = 0; c < channels.size(); ++c) {
      const double late = delayed_[c][at_];
      delayed_[c][at_] = channels[c][n];
      channels[c][n] = gain_ == 1.0 ? late : std::clamp(late * gain_, -ceiling, ceiling);
    }
    deepest_ = std::min(deepest_, gain_);
    at_ = (at_ + 1) % lookahead_frames;
  }
}

double Limiter::take_reduction() {
  const double deepest = deepest_;
  deepest_ = 1.0;
  return deepest;
}

}  // namespace ressort::engine
