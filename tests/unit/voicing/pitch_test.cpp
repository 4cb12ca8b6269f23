// The tuner of ressort_voicing, on sounds whose pitch is known.
#include <cmath>
#include <numbers>
#include <vector>

#include "tests/bench/voicing/sound.h"
#include "tests/support/catch.h"

namespace ressort::voicing {
namespace {

constexpr double rate_hz = 44100.0;

struct Sine {
  double hz;
  double level;
};

Stereo sum_of(const std::vector<Sine>& sines) {
  Stereo sound{.channels = {}, .rate_hz = rate_hz};
  for (int n = 0; n < static_cast<int>(1.5 * rate_hz); ++n) {
    double y = 0.0;
    for (const Sine& sine : sines) {
      y += sine.level * std::sin(2.0 * std::numbers::pi * sine.hz * n / rate_hz);
    }
    sound.channels[0].push_back(y);
    sound.channels[1].push_back(0.5 * y);
  }
  return sound;
}

double yin_cents(const Stereo& sound, double hz) {
  return cents(yin_hz(sound, hz / 1.5, hz * 1.5), hz);
}

// Five equal partials of a stiff string whose first partial is `hz`.
Stereo stiff_string(double hz, double stiffness) {
  std::vector<Sine> partials;
  for (int n = 1; n <= 5; ++n) {
    partials.push_back({hz * n * std::exp2(stretch_cents(n, stiffness) / 1200.0), 0.1});
  }
  return sum_of(partials);
}

}  // namespace

TEST_CASE("the tuner finds the pitch and the stiffness of a stiff string", "[pitch]") {
  // Partial 5 of B = 8.5e-4 is 600 log2((1 + 25 B) / (1 + B)) = 17.47 cents sharp.
  CHECK(stretch_cents(5, 8.5e-4) == Approx(17.47).margin(0.01));
  for (const double mistuning : {-4.0, 0.0, 7.0}) {
    const double hz = 493.88 * std::exp2(mistuning / 1200.0);
    const Stereo sound = stiff_string(hz, 8.5e-4);
    const PartialsPitch partials = partials_pitch(sound, 493.88);
    CHECK(partials.cents == Approx(mistuning).margin(0.05));
    CHECK(partials.stiffness == Approx(8.5e-4).epsilon(0.02));
    // YIN alone is sharp, because it weights partial n by n^2; not in a band around one partial.
    CHECK(yin_cents(sound, 493.88) > mistuning + 5.0);
    CHECK(yin_cents(band_around(sound, 493.88, 0.2), 493.88) == Approx(mistuning).margin(0.1));
  }
}

TEST_CASE("a harmonic sound has no stiffness", "[pitch]") {
  for (const double hz : {55.0, 220.0, 1760.0}) {
    const PartialsPitch partials = partials_pitch(stiff_string(hz, 0.0), hz);
    CHECK(partials.cents == Approx(0.0).margin(0.05));
    CHECK(partials.stiffness < 1e-5);
  }
}

TEST_CASE("a bar's second mode misleads YIN, but not in a band around the first", "[pitch]") {
  // A free bar's second mode is at 2.756 times the first.
  const Stereo sound = sum_of({{466.16, 0.1}, {2.756 * 466.16, 0.3}});
  CHECK(std::fabs(yin_cents(sound, 466.16)) > 5.0);
  CHECK(yin_cents(band_around(sound, 466.16, 0.2), 466.16) == Approx(0.0).margin(0.1));
}

TEST_CASE("a band without a phase shift attenuates by its Gaussian", "[pitch]") {
  // 1.5 times the frequency is 2.5 standard deviations away: exp(-3.125) = -27.1 dB.
  for (const double times : {1.0, 1.5}) {
    const Stereo sound = sum_of({{times * 440.0, 0.5}});
    const Stereo band = band_around(sound, 440.0, 0.2);
    const double gain = std::exp(-0.5 * std::pow((times - 1.0) / 0.2, 2.0));
    for (std::size_t n = 4410; n < 8820; ++n) {
      REQUIRE(band.channels[0][n] == Approx(gain * sound.channels[0][n]).margin(1e-4));
      REQUIRE(band.channels[1][n] == Approx(gain * sound.channels[1][n]).margin(1e-4));
    }
  }
}

}  // namespace ressort::voicing
