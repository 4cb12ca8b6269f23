// Timbre descriptors against values derived by hand or computed independently from the definitions
// of the Timbre Toolbox, and sounds without descriptors.
#include <complex>
#include <limits>
#include <numbers>

#include "core/analysis/timbre/descriptors.h"
#include "core/analysis/timbre/envelope.h"
#include "core/analysis/timbre/frame_analysis.h"
#include "core/analysis/timbre/modal_spectrum.h"
#include "core/analysis/timbre/pitch.h"
#include "core/analysis/timbre/window.h"
#include "core/linear_algebra/fourier.h"
#include "tests/support/catch.h"
#include "tests/support/random.h"
#include "tests/support/rooms.h"

namespace ressort::timbre_test {

using namespace support;

namespace {

constexpr auto magnitude = SpectrumKind::magnitude;
constexpr auto of_power = SpectrumKind::power;

Approx near(double number) {
  return Approx(number).epsilon(1e-6).margin(1e-12);
}

// Harmonics of 220 Hz with amplitudes 1/k, every `step`th.
std::vector<Partial> harmonics(int count, int step = 1) {
  std::vector<Partial> partials;
  for (int k = 1; k <= count; k += step) {
    partials.push_back({220.0 * k, 1.0 / k});
  }
  return partials;
}

}  // namespace

TEST_CASE("Four spectral lines have hand-computed descriptors", "[timbre]") {
  // p = 0.1 to 0.4: mean 300, variance (40000 + 2 * 10000 + 0 + 4 * 10000) / 10 = 10000.
  const std::vector<double> f{100.0, 200.0, 300.0, 400.0};
  const auto shape = spectral_shape(f, std::vector{1.0, 2.0, 3.0, 4.0}, magnitude);
  REQUIRE(shape);
  CHECK(shape->centroid_hz == near(300.0));
  CHECK(shape->spread_hz == near(100.0));
  CHECK(*shape->skewness == near(-0.6));
  CHECK(*shape->kurtosis == near(2.2));
  CHECK(*shape->slope == near(0.001));
  CHECK(*shape->decrease == near(1.0 / 3.0));
  CHECK(shape->rolloff95_hz == 400.0);
  CHECK(shape->flatness == near(0.885345536));
  CHECK(shape->crest == near(1.6));
  CHECK(shape->entropy == near(0.923219672));

  // The rolloff is the same for amplitudes and powers.
  const auto squared = spectral_shape(f, std::vector{1.0, 4.0, 9.0, 16.0}, of_power);
  CHECK(squared->rolloff95_hz == 400.0);
  CHECK(squared->centroid_hz == near(1000.0 / 3.0));  // (1 + 8 + 27 + 64) / 30 * 100
}

TEST_CASE("Ten harmonics have the descriptors of other programs", "[timbre]") {
  const auto shape = spectral_shape(harmonics(10), magnitude);
  REQUIRE(shape);
  CHECK(shape->centroid_hz == near(751.117735));
  CHECK(shape->spread_hz == near(587.089948));
  CHECK(*shape->skewness == near(0.984384710));
  CHECK(*shape->kurtosis == near(2.82697121));
  CHECK(*shape->slope == near(-1.14921679e-4));
  CHECK(*shape->decrease == near(-1.0));
  CHECK(shape->rolloff95_hz == 1320.0);
  CHECK(shape->flatness == near(0.753891822));
  CHECK(shape->crest == near(3.41417152));

  const auto harmonic = harmonic_shape(harmonics(10), 220.0);
  REQUIRE(harmonic);
  CHECK(harmonic->inharmonicity == 0.0);
  CHECK(harmonic->tristimulus[0] == Approx(0.341417).epsilon(2e-6));
  CHECK(harmonic->tristimulus[1] == Approx(0.369869).epsilon(2e-6));
  CHECK(harmonic->tristimulus[2] == Approx(0.288714).epsilon(2e-6));
  CHECK(*harmonic->odd_to_even == near(3.23546315));
}

TEST_CASE("Odd harmonics have the descriptors of other programs", "[timbre]") {
  const auto shape = spectral_shape(harmonics(9, 2), magnitude);
  REQUIRE(shape);
  CHECK(shape->centroid_hz == near(615.452931));
  CHECK(shape->spread_hz == near(546.091489));
  CHECK(*shape->skewness == near(1.22358785));
  CHECK(*shape->kurtosis == near(3.30346491));
  CHECK(*shape->decrease == near(-2.0));

  // The even ones are present as harmonics, but silent.
  const auto all = harmonics_of(harmonics(9, 2), 220.0);
  REQUIRE(all.size() == 9);
  CHECK(all[3].amplitude == 0.0);
  CHECK(all[3].frequency_hz == near(880.0));
  CHECK_FALSE(harmonic_shape(all, 220.0)->odd_to_even);
}

TEST_CASE("A stiff string has the inharmonicity of other programs", "[timbre]") {
  constexpr double b = 1e-3;
  std::vector<Partial> partials;
  for (int k = 1; k <= 10; ++k) {
    partials.push_back({220.0 * k * std::sqrt(1.0 + b * k * k) / std::sqrt(1.0 + b), 1.0 / k});
  }
  CHECK(harmonic_shape(partials, 220.0)->inharmonicity == near(0.0331121446));
  CHECK(harmonic_shape(harmonics_of(partials, 220.0), 220.0)->inharmonicity == near(0.0331121446));
}

TEST_CASE("Harmonic deviation and noisiness equal hand-computed values", "[timbre]") {
  // Neighbours' means 4, 3, 2, 1.5: |4 - 4| + |1 - 3| + |4 - 2| + |1 - 2.5|, a fourth of it.
  const std::vector<Partial> partials{{100, 4.0}, {200, 1.0}, {300, 4.0}, {400, 1.0}};
  const auto shape = harmonic_shape(partials, 100.0);
  CHECK(shape->harmonic_deviation == near((0.0 + 2.0 + 2.0 + 1.5) / 4.0));
  CHECK(*noisiness(partials, 68.0) == near(0.5));  // 34 of 68
  CHECK(*noisiness(partials, 10.0) == 0.0);        // More than the energy given.
  CHECK_FALSE(noisiness(partials, 0.0));
}

TEST_CASE("An attack and a decay have the descriptors of other programs", "[timbre]") {
  constexpr double rate = 48000.0;
  std::vector<double> envelope;
  std::vector<double> squared;
  for (int n = 0; n < 96000; ++n) {
    envelope.push_back(n < 480 ? n / 480.0 : std::exp(-std::log(1000.0) * (n - 480) / rate));
    squared.push_back(envelope.back() * envelope.back());
  }
  const auto shape = temporal_shape(envelope, rate);
  REQUIRE(shape);
  CHECK(shape->temporal_centroid_s == near(0.1498184));
  CHECK(temporal_shape(squared, rate)->temporal_centroid_s == near(0.0790858));
  CHECK(shape->effective_duration_s == near(0.1386458));
  CHECK(shape->log_attack_time == near(std::log10(0.009)));  // 10 % to 100 % of a straight line.
  CHECK(*shape->decay_slope == near(-std::log(1000.0)));
}

TEST_CASE("An attack excludes steps above three times the mean effort", "[timbre]") {
  // A tenth every 100 samples, but 1000 from 10 to 20 %, and 1000 from 80 to 90 %.
  std::vector<double> envelope{0.0};
  for (int tenth = 1; tenth <= 10; ++tenth) {
    const int samples = tenth == 2 || tenth == 9 ? 1000 : 100;
    const double before = envelope.back();
    for (int n = 1; n <= samples; ++n) {
      envelope.push_back(n < samples ? before + 0.1 * n / samples : 0.1 * tenth);
    }
  }
  // 20 to 80 %: 600 samples.
  CHECK(temporal_shape(envelope, 1000.0)->log_attack_time == near(std::log10(0.6)));
}

TEST_CASE("Empty and silent input has no descriptors", "[timbre]") {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<double> f{100.0, 200.0};
  CHECK_FALSE(spectral_shape(f, std::vector{0.0, 0.0}, magnitude));
  CHECK_FALSE(spectral_shape(f, std::vector{1.0, nan}, magnitude));
  CHECK_FALSE(spectral_shape(f, std::vector{1.0, -1.0}, magnitude));
  CHECK_FALSE(spectral_shape({}, {}, magnitude));
  CHECK_FALSE(spectral_flux(std::vector{0.0, 0.0}, std::vector{1.0, 0.0}));
  CHECK_FALSE(harmonic_shape({}, 220.0));
  CHECK_FALSE(harmonic_shape(std::vector<Partial>{{220.0, 0.0}}, 220.0));
  CHECK_FALSE(harmonic_shape(harmonics(3), 0.0));
  CHECK(harmonics_of(harmonics(3), 0.0).empty());
  CHECK_FALSE(temporal_shape({}, 48000.0));
  CHECK_FALSE(temporal_shape(std::vector{0.0, 0.0}, 48000.0));

  const auto one = spectral_shape(std::vector{440.0}, std::vector{1e-300}, magnitude);
  REQUIRE(one);
  CHECK(one->centroid_hz == near(440.0));
  CHECK(one->spread_hz == 0.0);
  CHECK_FALSE(one->skewness);
  CHECK_FALSE(one->kurtosis);
  CHECK_FALSE(one->slope);
  CHECK_FALSE(one->decrease);
  CHECK(one->rolloff95_hz == 440.0);
  CHECK(one->flatness == near(1.0));
  CHECK(one->crest == near(1.0));
  CHECK(one->entropy == 0.0);

  const auto first = spectral_shape(f, std::vector{1.0, 0.0}, magnitude);
  CHECK(first->spread_hz == 0.0);
  CHECK_FALSE(first->decrease);
  CHECK(first->flatness == 0.0);
  CHECK(first->entropy == 0.0);

  // A click is one sample long.
  const auto click = temporal_shape(std::vector{1.0, 0.0, 0.0}, 1000.0);
  CHECK(click->log_attack_time == near(-3.0));
  CHECK(click->effective_duration_s == near(0.001));
  CHECK_FALSE(click->decay_slope);
}

TEST_CASE("A shape does not depend on level or pitch", "[timbre]") {
  Random random(7);
  for (int round = 0; round < 100; ++round) {
    std::vector<double> f;
    std::vector<double> a;
    std::vector<double> f_twice;
    std::vector<double> quiet;
    const std::size_t count = 2 + random.below(200);
    for (std::size_t k = 0; k < count; ++k) {
      f.push_back(10.0 * static_cast<double>(k) + random.uniform(0.0, 9.0));
      a.push_back(random.uniform(0.0, 1.0));
      f_twice.push_back(2.0 * f.back());
      quiet.push_back(1e-200 * a.back());
    }
    const auto shape = spectral_shape(f, a, magnitude);
    const auto other = spectral_shape(f_twice, quiet, magnitude);
    REQUIRE(shape);
    REQUIRE(other);
    CHECK(other->centroid_hz == near(2.0 * shape->centroid_hz));
    CHECK(other->spread_hz == near(2.0 * shape->spread_hz));
    CHECK(*other->skewness == near(*shape->skewness));
    CHECK(*other->slope == near(*shape->slope / 2.0));
    CHECK(other->rolloff95_hz == 2.0 * shape->rolloff95_hz);
    CHECK(other->flatness == near(shape->flatness));
    CHECK(other->entropy == near(shape->entropy));
    CHECK(*spectral_flux(a, quiet) == Approx(0.0).margin(1e-12));
  }
  CHECK(*spectral_flux(std::vector{1.0, 0.0}, std::vector{0.0, 5.0}) == 1.0);
  CHECK(*spectral_flux(std::vector{1.0, 0.0}, std::vector{1.0, 1.0}) == near(1.0 - std::sqrt(0.5)));
}

TEST_CASE("A window's response equals the sum over its weights", "[timbre]") {
  Random random(3);
  for (const Window window : {Window::hann, Window::hamming, Window::blackman, Window::none}) {
    for (int round = 0; round < 50; ++round) {
      const std::size_t size = 8 + random.below(5000);
      // Decays from none to complete within a frame; rotations of whole bins, of none and of any.
      const double bin = 2.0 * std::numbers::pi / static_cast<double>(size);
      const std::complex<double> log_z(
          round % 3 == 0 ? 0.0 : -std::pow(10.0, random.uniform(-9.0, 0.0)),
          round % 5 == 0 ? bin * static_cast<double>(random.below(4))
                         : random.uniform(-3.1, 3.1) * (round % 5 == 1 ? 0.0 : 1.0));
      const auto weights = window_weights(window, size);
      std::complex<double> sum;
      double all = 0.0;
      for (std::size_t m = 0; m < size; ++m) {
        sum += weights[m] * std::exp(log_z * static_cast<double>(m));
        all += weights[m];
      }
      INFO(size << " samples, log z " << log_z.real() << " " << log_z.imag());
      CHECK(std::abs(window_response(window, size, log_z) - sum / all) < 1e-11);
    }
  }
}

TEST_CASE("Descriptors of modes in a frame match the synthesised sound", "[timbre]") {
  constexpr double rate = 48000.0;
  const double bell[][3] = {{220.0, 2.0, 1.0},
                            {441.5, 1.2, 0.6},
                            {667.0, 0.8, 0.4},
                            {1210.0, 0.4, 0.3},
                            {2903.0, 0.15, 0.2}};
  std::vector<DecayingPartial> partials;
  for (const auto& [frequency_hz, t60_s, amplitude] : bell) {
    partials.push_back({frequency_hz, pole_radius(t60_s, rate), -amplitude});
  }
  const struct {
    std::size_t at;
    SpectrumKind kind;
    double centroid_hz;
  } expected[] = {{0, magnitude, 550.24},
                  {24000, magnitude, 263.29},
                  {0, of_power, 352.09},
                  {24000, of_power, 227.316}};
  for (const auto& frame : expected) {
    const auto lines = partials_in_frame(partials, {Window::hann, 2048, frame.at}, rate);
    REQUIRE(lines.size() == 5);
    // Compared to the known digits.
    CHECK(spectral_shape(lines, frame.kind)->centroid_hz ==
          Approx(frame.centroid_hz).margin(0.005));
  }
  // Partials above half the rate are left out; an undamped one keeps its level.
  const auto one =
      partials_in_frame(std::vector<DecayingPartial>{{30000.0, 1.0, 1.0}, {440.0, 1.0, -0.5}},
                        {Window::blackman, 512, 100000}, rate);
  REQUIRE(one.size() == 1);
  CHECK(one[0].amplitude == near(0.5));
}

namespace {

// Sum of A e^(-6.9078 t/T) sin 2 pi f t at 48 kHz: a bell.
std::vector<double> bell(std::size_t samples) {
  const double modes[][3] = {{220.0, 2.0, 1.0},
                             {441.5, 1.2, 0.6},
                             {667.0, 0.8, 0.4},
                             {1210.0, 0.4, 0.3},
                             {2903.0, 0.15, 0.2}};
  std::vector<double> sound(samples);
  for (const auto& [f, t60, a] : modes) {
    for (std::size_t n = 0; n < samples; ++n) {
      const double t = static_cast<double>(n) / 48000.0;
      sound[n] +=
          a * std::exp(-std::log(1000.0) * t / t60) * std::sin(2.0 * std::numbers::pi * f * t);
    }
  }
  return sound;
}

FrameTimbre frame_of(std::span<const double> samples, SpectrumKind kind,
                     std::optional<double> f0_hz = {}) {
  FrameAnalysis frames({.rate_hz = 48000.0, .size = samples.size(), .kind = kind, .f0_hz = f0_hz});
  return frames.next(samples);
}

}  // namespace

TEST_CASE("A frame of harmonics has the descriptors of other programs", "[timbre]") {
  std::vector<double> sound(4096);
  for (std::size_t n = 0; n < sound.size(); ++n) {
    for (int h = 1; h <= 10; ++h) {
      sound[n] +=
          std::cos(2.0 * std::numbers::pi * 40.0 * h * static_cast<double>(n) / 4096.0 + h) / h;
    }
  }
  const auto shape = frame_of(sound, magnitude).shape;
  REQUIRE(shape);
  CHECK(shape->centroid_hz == near(1600.3929));
  CHECK(shape->spread_hz == near(1250.92932));
  CHECK(*shape->skewness == Approx(0.98432).margin(5e-6));  // Compared to the known digits.
  CHECK(*shape->kurtosis == Approx(2.82699).margin(5e-6));
  CHECK(shape->rolloff95_hz == 2812.5);
  const auto squared = frame_of(sound, of_power).shape;
  CHECK(squared->centroid_hz == near(885.909444));
  CHECK(squared->spread_hz == near(795.621404));
  CHECK(*squared->skewness == Approx(2.53698).margin(5e-6));
  CHECK(*squared->kurtosis == Approx(9.65703).margin(5e-6));
  CHECK(squared->rolloff95_hz == 2812.5);
}

TEST_CASE("A bell's frames match other programs and its own modes", "[timbre]") {
  const auto sound = bell(26048);
  const struct {
    std::size_t at;
    SpectrumKind kind;
    double centroid_hz;
    double spread_hz;
    double centroid_bound;  // Bound of the error of the closed form.
    double spread_bound;
  } frames[] = {{0, magnitude, 555.519845, 566.711753, 0.01, 0.034},
                {0, of_power, 352.572113, 281.340833, 0.0014, 0.052},
                {24000, magnitude, 262.306912, 103.973251, 0.01, 0.034},
                {24000, of_power, 227.319045, 42.6790185, 0.0014, 0.052}};
  std::vector<DecayingPartial> partials;
  for (const auto& [f, t60, a] : {std::array{220.0, 2.0, 1.0},
                                  {441.5, 1.2, 0.6},
                                  {667.0, 0.8, 0.4},
                                  {1210.0, 0.4, 0.3},
                                  {2903.0, 0.15, 0.2}}) {
    partials.push_back({f, pole_radius(t60, 48000.0), a});
  }
  for (const auto& expected : frames) {
    INFO("at " << expected.at);
    const auto shape = frame_of(std::span(sound).subspan(expected.at, 2048), expected.kind).shape;
    REQUIRE(shape);
    CHECK(shape->centroid_hz == near(expected.centroid_hz));
    CHECK(shape->spread_hz == near(expected.spread_hz));
    const auto closed = spectral_shape(
        partials_in_frame(partials, {Window::hann, 2048, expected.at}, 48000.0), expected.kind);
    CHECK(closed->centroid_hz == Approx(shape->centroid_hz).epsilon(expected.centroid_bound));
    CHECK(closed->spread_hz == Approx(shape->spread_hz).epsilon(expected.spread_bound));
  }
}

TEST_CASE("Decaying partials are found between bins", "[timbre]") {
  // For a single partial the window's derivative gives the exact frequency.
  for (const double f : {440.0, 445.3, 451.0, 12345.6}) {
    std::vector<double> sound(2048);
    for (std::size_t n = 0; n < sound.size(); ++n) {
      const double t = static_cast<double>(n) / 48000.0;
      sound[n] =
          0.5 * std::exp(-std::log(1000.0) * t) * std::sin(2.0 * std::numbers::pi * f * t + 1.0);
    }
    FrameAnalysis frames({.rate_hz = 48000.0});
    static_cast<void>(frames.next(sound));
    const auto partials = frames.partials();
    const auto loudest = std::max_element(
        partials.begin(), partials.end(),
        [](const Partial& a, const Partial& b) { return a.amplitude < b.amplitude; });
    REQUIRE(loudest != partials.end());
    INFO(f);
    CHECK(loudest->frequency_hz == Approx(f).margin(2e-3));
    // Close to its amplitude in the middle of the frame; the window does not cover all of it.
    CHECK(loudest->amplitude ==
          Approx(0.5 * std::exp(-std::log(1000.0) * 1024.0 / 48000.0)).epsilon(2e-3));
  }
}

TEST_CASE("A sound's harmonics have the descriptors of its partials", "[timbre]") {
  constexpr double b = 1e-3;
  std::vector<double> sound(4096);
  std::vector<double> odd(4096);
  for (std::size_t n = 0; n < sound.size(); ++n) {
    const double turn = 2.0 * std::numbers::pi * 220.0 * static_cast<double>(n) / 48000.0;
    for (int k = 1; k <= 10; ++k) {
      sound[n] += std::sin(turn * k * std::sqrt(1.0 + b * k * k) / std::sqrt(1.0 + b) + k) / k;
      odd[n] += k % 2 == 1 ? std::sin(turn * k) / k : 0.0;
    }
  }
  const auto stiff = frame_of(sound, magnitude, 220.0);
  REQUIRE(stiff.harmonics);
  // The windows of neighbours overlap a little.
  CHECK(stiff.harmonics->inharmonicity == Approx(0.0331121446).epsilon(5e-3));
  CHECK(*stiff.harmonics->odd_to_even == Approx(3.23546315).epsilon(1e-3));
  CHECK(stiff.harmonics->tristimulus[0] == Approx(0.341417).epsilon(1e-3));
  CHECK(*stiff.noisiness < 1e-3);
  // No energy between the odd harmonics counts as an even one.
  CHECK(frame_of(odd, magnitude, 220.0).harmonics->odd_to_even.value_or(1e9) > 1e6);
  CHECK(*find_f0(sound, 48000.0) == Approx(220.0).epsilon(1e-4));
  CHECK(*find_f0(odd, 48000.0) == Approx(220.0).epsilon(1e-4));

  Random random(5);
  std::vector<double> noise(4096);
  for (double& sample : noise) {
    sample = random.uniform(-1.0, 1.0);
  }
  CHECK(*frame_of(noise, magnitude, 220.0).noisiness > 0.5);
  CHECK_FALSE(find_f0(noise, 48000.0));
  CHECK_FALSE(find_f0(std::vector<double>(4096), 48000.0));
}

TEST_CASE("An envelope follows the amplitude of an oscillation", "[timbre]") {
  // A carrier that rises in 10 ms and then falls by 60 dB per second; the low-pass rounds the
  // corners.
  std::vector<double> sound;
  for (int n = 0; n < 96000; ++n) {
    const double a = n < 480 ? n / 480.0 : std::exp(-std::log(1000.0) * (n - 480) / 48000.0);
    sound.push_back(0.3 * a * std::sin(2.0 * std::numbers::pi * 997.0 * n / 48000.0));
  }
  std::vector<double> envelope;
  Envelope follower(48000.0, [&](double value) { envelope.push_back(value); });
  for (std::size_t n = 0; n < sound.size(); n += 777) {
    follower.add(std::span(sound).subspan(n, std::min<std::size_t>(777, sound.size() - n)));
  }
  follower.end();
  REQUIRE(envelope.size() == sound.size());
  for (const int n : {4000, 20000, 40000}) {
    INFO(n);
    CHECK(envelope[static_cast<std::size_t>(n)] ==
          Approx(0.3 * std::exp(-std::log(1000.0) * (n - 480) / 48000.0)).epsilon(2e-3));
  }
  const auto shape = temporal_shape(envelope, 48000.0);
  CHECK(shape->temporal_centroid_s == Approx(0.1498184).margin(3e-4));
  CHECK(shape->effective_duration_s == Approx(0.1386458).margin(5e-3));
  CHECK(*shape->decay_slope == Approx(-std::log(1000.0)).epsilon(2e-2));
  CHECK(std::pow(10.0, shape->log_attack_time) == Approx(0.009).margin(3e-3));
}

TEST_CASE("A frame contains no NaN", "[timbre]") {
  FrameAnalysis frames({.rate_hz = 48000.0, .size = 64, .f0_hz = 1500.0});
  const auto silence = frames.next(std::vector<double>(64));
  CHECK(silence.rms == 0.0);
  CHECK_FALSE(silence.shape);
  CHECK_FALSE(silence.flux);
  CHECK_FALSE(silence.harmonics);
  CHECK_FALSE(frames.next(std::vector<double>(64, std::nan(""))).shape);
  const auto constant = frames.next(std::vector<double>(64, 1.0));
  CHECK_FALSE(constant.flux);  // After silence.
  REQUIRE(constant.shape);
  CHECK(std::isfinite(constant.shape->centroid_hz));
  CHECK(*frames.next(std::vector<double>(64, 0.5)).flux == Approx(0.0).margin(1e-12));
}

TEST_CASE("The Fourier transform of any size equals its defining sum", "[timbre]") {
  Random random(9);
  for (const std::size_t size : {2u, 3u, 4u, 6u, 17u, 50u, 64u, 1000u}) {
    std::vector<double> x(size);
    for (double& sample : x) {
      sample = random.uniform(-1.0, 1.0);
    }
    Fourier fourier(size);
    std::vector<std::complex<double>> bins(fourier.bins());
    fourier.forward(x, bins);
    for (std::size_t k = 0; k < bins.size(); ++k) {
      std::complex<double> sum;
      for (std::size_t n = 0; n < size; ++n) {
        sum += x[n] * std::polar(1.0, -2.0 * std::numbers::pi * static_cast<double>(n * k % size) /
                                          static_cast<double>(size));
      }
      CHECK(std::abs(bins[k] - sum) < 1e-12 * static_cast<double>(size));
    }
    if (size % 2 == 0) {
      std::vector<double> back(size);
      fourier.inverse(bins, back);
      for (std::size_t n = 0; n < size; ++n) {
        CHECK(back[n] == Approx(x[n]).margin(1e-12));
      }
    }
  }
}

}  // namespace ressort::timbre_test
