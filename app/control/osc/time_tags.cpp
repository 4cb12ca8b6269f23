#include "app/control/osc/time_tags.h"

#include <cmath>
#include <cstdlib>
#include <ctime>
#include <limits>

#include "app/devices/audio.h"

namespace ressort::control {
namespace {

constexpr double tags_per_second = 4294967296.0;  // NTP time counts units of 2^-32 s since 1900.
constexpr std::uint64_t ntp_to_unix_s = 2208988800;
constexpr std::int64_t one_second_ns = 1'000'000'000;
constexpr std::int64_t clock_step_ns = 5'000'000;
constexpr double max_anchor_error_s = 0.01;
constexpr double anchor_life_s = 10.0;  // Lifetime without use.

// Returns the offset of the wall clock to the monotonic clock. Takes the smallest interval of
// several readings, since the others were interrupted.
std::int64_t wall_offset_ns() {
  std::int64_t closest = std::numeric_limits<std::int64_t>::max();
  std::int64_t offset = 0;
  for (int i = 0; i < 8; ++i) {
    timespec wall{};
    const std::int64_t before = monotonic_ns();
    clock_gettime(CLOCK_REALTIME, &wall);
    const std::int64_t took = monotonic_ns() - before;
    if (took < closest) {
      closest = took;
      offset = wall.tv_sec * one_second_ns + wall.tv_nsec - (before + took / 2);
    }
  }
  return offset;
}

}  // namespace

double seconds_between(std::uint64_t from, std::uint64_t to) {
  return static_cast<double>(static_cast<std::int64_t>(to - from)) / tags_per_second;
}

TagClock::TagClock() : offset_ns_(wall_offset_ns()) {}

void TagClock::follow_wall_clock() {
  const std::int64_t offset_ns = wall_offset_ns();
  if (std::abs(offset_ns - offset_ns_) > clock_step_ns) {
    offset_ns_ = offset_ns;
    rate_hz_ = 0.0;
  }
}

std::uint64_t TagClock::now(const ClockReading& clock) const {
  const auto wall_ns = static_cast<std::uint64_t>(clock.time_ns + offset_ns_);
  const std::uint64_t fraction_ns = wall_ns % one_second_ns;
  return ((wall_ns / one_second_ns + ntp_to_unix_s) << 32) + (fraction_ns << 32) / one_second_ns;
}

std::int64_t TagClock::frame(std::uint64_t tag, const ClockReading& clock) {
  const std::uint64_t now_tag = now(clock);
  const double ahead_s = seconds_between(now_tag, tag);
  const std::int64_t by_clock = clock.frame + std::llround(ahead_s * clock.rate_hz);
  if (std::fabs(ahead_s) > tag_horizon_s) {
    return by_clock;
  }
  const std::int64_t by_anchor = frame_ + std::llround(seconds_between(tag_, tag) * clock.rate_hz);
  const bool is_anchored =
      rate_hz_ == clock.rate_hz && seconds_between(used_, now_tag) < anchor_life_s &&
      static_cast<double>(std::abs(by_anchor - by_clock)) <= max_anchor_error_s * clock.rate_hz;
  used_ = now_tag;
  if (is_anchored) {
    return by_anchor;
  }
  tag_ = tag;
  frame_ = by_clock;
  rate_hz_ = clock.rate_hz;
  return by_clock;
}

}  // namespace ressort::control
