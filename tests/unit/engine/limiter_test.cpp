// The limiter never exceeds the ceiling and does not change anything below it.
#include "core/engine/limiter.h"

#include "tests/support/player.h"

namespace ressort::limiter_test {
namespace {

using namespace support;

constexpr std::size_t late = Limiter::lookahead_frames;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

// Runs one channel through a new limiter in blocks.
std::vector<double> limited(std::vector<double> y, std::size_t block = 64) {
  Limiter limiter(44100.0);
  for (std::size_t at = 0; at < y.size(); at += block) {
    double* const channel[] = {y.data() + at};
    limiter.process(channel, std::min(block, y.size() - at));
  }
  return y;
}

std::vector<double> sine(double amplitude, double hz, std::size_t frames) {
  std::vector<double> y(frames);
  for (std::size_t n = 0; n < frames; ++n) {
    y[n] = amplitude * std::sin(2.0 * std::numbers::pi * hz / 44100.0 * static_cast<double>(n));
  }
  return y;
}

}  // namespace

TEST_CASE("below the ceiling the limiter is a delay of 48 frames, bit for bit", "[limiter]") {
  Random random(1);
  std::vector<double> y(20000);
  for (double& sample : y) {
    sample = random.uniform(-Limiter::ceiling, Limiter::ceiling);
  }
  y[777] = Limiter::ceiling;
  y[778] = -Limiter::ceiling;
  for (const std::size_t block : {1u, 64u, 1000u}) {
    const auto out = limited(y, block);
    CHECK(peak(std::span(out).first(late)) == 0.0);
    CHECK(std::equal(out.begin() + late, out.end(), y.begin()));
  }
}

TEST_CASE("the output never exceeds the ceiling", "[limiter]") {
  std::vector<std::vector<double>> loud;
  for (const double amplitude : {1.0, 2.0, 10.0, 1e6, 1e12, 1e300}) {
    loud.push_back(sine(amplitude, 100.0, 20000));
    loud.push_back(sine(amplitude, 9000.0, 20000));
    std::vector<double> step(5000, 0.5);
    std::fill(step.begin() + 1000, step.begin() + 3000, amplitude);
    loud.push_back(step);
    std::vector<double> impulses(20000, 0.1);
    for (std::size_t n = 100; n < impulses.size(); n += n % 47 + 1) {
      impulses[n] = n % 2 == 0 ? amplitude : -amplitude;
    }
    loud.push_back(impulses);
  }
  Random random(4);
  std::vector<double> wild(50000);
  for (double& sample : wild) {
    const double kind = random.uniform(0, 1);
    sample = kind < 0.01   ? nan
             : kind < 0.02 ? infinity
             : kind < 0.03 ? -infinity
                           : std::exp(random.uniform(-20, 20));
  }
  loud.push_back(wild);
  for (const auto& y : loud) {
    const auto out = limited(y);
    CHECK(peak(out) <= Limiter::ceiling);
    CHECK(std::all_of(out.begin(), out.end(), [](double s) { return std::isfinite(s); }));
    // The limiter must not attenuate everything. Beyond 1e13 the gain has no digits left.
    CHECK((peak(out) > 0.9 || peak(y) > 1e13));
  }
}

TEST_CASE("the block size makes no difference", "[limiter]") {
  Random random(3);
  std::vector<double> y(20000);
  double loudness = 0.5;
  for (std::size_t n = 0; n < y.size(); ++n) {
    loudness = n % 500 == 0 ? random.uniform(0.5, 1.2) : loudness;
    y[n] = random.below(900) == 0 ? nan : random.uniform(-loudness, loudness);
  }
  const auto expected = limited(y, 1);
  CHECK(peak(expected) == Limiter::ceiling);
  for (const std::size_t block : {5u, 48u, 64u, 1000u}) {
    CHECK(limited(y, block) == expected);
  }
}

TEST_CASE("a NaN becomes silence and its neighbours are kept", "[limiter]") {
  std::vector<double> y(500, 0.25);
  y[100] = nan;
  y[101] = infinity;
  y[102] = -infinity;
  const auto out = limited(y);
  for (std::size_t n = 0; n < 500 - late; ++n) {
    CHECK(out[n + late] == (n >= 100 && n <= 102 ? 0.0 : 0.25));
  }
}

TEST_CASE("the gain ramps down before the peak and recovers slowly", "[limiter]") {
  // A constant carrier and one peak of ten times the ceiling: the gain is the ratio of output to
  // input.
  std::vector<double> y(88200, 0.5);
  y[10000] = 10.0 * Limiter::ceiling;
  const auto out = limited(y);
  CHECK(out[10000 + late] == Approx(Limiter::ceiling).epsilon(1e-12));
  std::vector<double> gain;
  for (std::size_t n = late; n < y.size(); ++n) {
    gain.push_back(out[n] / y[n - late]);
  }
  // The gain falls linearly over the 48 frames before the peak, in steps of at most 0.9/48.
  INFO(show(largest_step(gain)));
  CHECK(largest_step(gain) <= 0.9 / static_cast<double>(late) * (1 + 1e-9));
  CHECK(gain[10000 - late - 1] == 1.0);
  CHECK(gain[10000] == Approx(0.1).epsilon(1e-12));
  // It recovers as 1 - 0.9 exp(-t / 80 ms), averaged over 48 frames.
  CHECK(gain[10000 + 3528 + 24] == Approx(1.0 - 0.9 * std::exp(-1.0)).epsilon(0.002));
  for (std::size_t n = 10000 + 49; n < gain.size(); ++n) {
    REQUIRE(gain[n] >= gain[n - 1] - 1e-12);
  }
  CHECK(gain.back() == 1.0);  // after the recovery it is a pure delay again
}

TEST_CASE("the reduction is exact at any depth", "[limiter]") {
  // One peak per depth: earlier gains leave no error in later ones.
  for (const double amplitude : {1e3, 1e9, 1e15, 1e17, 1e18, 1e100, 1e300}) {
    Limiter limiter(44100.0);
    std::vector<double> y(20 * late, 0.0);
    std::fill(y.begin() + 10, y.begin() + 4 * late, amplitude);
    double deepest = 1.0;
    for (double& sample : y) {
      double* const channel[] = {&sample};
      limiter.process(channel, 1);
      const double reduction = limiter.take_reduction();
      CHECK(reduction > 0.0);
      CHECK(reduction <= 1.0);
      deepest = std::min(deepest, reduction);
    }
    INFO(show(amplitude) << " " << show(deepest));
    CHECK(deepest == Approx(Limiter::ceiling / amplitude).epsilon(1e-14));
  }
}

TEST_CASE("all channels share one gain", "[limiter]") {
  Limiter limiter(44100.0);
  std::vector<double> left = sine(4.0, 300.0, 5000);
  std::vector<double> right(5000, 0.25);
  const std::vector<double> before = left;
  double* const channels[] = {left.data(), right.data()};
  limiter.process(channels, 5000);
  for (std::size_t n = late; n < 5000; ++n) {
    if (std::fabs(before[n - late]) > 0.1 && std::fabs(left[n]) < Limiter::ceiling) {
      REQUIRE(left[n] / before[n - late] == Approx(right[n] / 0.25).epsilon(1e-12));
    }
  }
  const double reduction = limiter.take_reduction();
  CHECK(reduction == Approx(Limiter::ceiling / 4.0).epsilon(0.001));
  CHECK(limiter.take_reduction() == 1.0);
}

}  // namespace ressort::limiter_test
