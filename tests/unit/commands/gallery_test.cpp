// The figures of a sound, against sounds whose figures are known by hand or by a standard.
#include <cmath>
#include <numbers>

#include "app/commands/gallery/page.h"
#include "app/commands/gallery/sound.h"
#include "app/commands/gallery/spectrogram.h"
#include "tests/support/catch.h"
#include "tests/support/rooms.h"

namespace ressort::gallery_test {
namespace {

constexpr double rate_hz = 48000.0;

std::vector<double> sine(double frequency_hz, double amplitude, double length_s,
                         double decay_per_s = 0.0) {
  std::vector<double> samples(static_cast<std::size_t>(length_s * rate_hz));
  for (std::size_t n = 0; n < samples.size(); ++n) {
    const double time_s = static_cast<double>(n) / rate_hz;
    samples[n] = amplitude * std::exp(-decay_per_s * time_s) *
                 std::sin(2.0 * std::numbers::pi * frequency_hz * time_s);
  }
  return samples;
}

Sound sound(std::vector<std::vector<double>> channels) {
  return {.rate_hz = rate_hz, .channels = std::move(channels)};
}

}  // namespace

TEST_CASE("loudness is that of BS.1770 and EBU Tech 3341", "[gallery]") {
  // BS.1770-4: a sine of 997 Hz at full scale in one channel reads -3.01 LKFS.
  const auto silence = std::vector<double>(static_cast<std::size_t>(20.0 * rate_hz));
  const auto one = loudness_lufs(sound({sine(997.0, 1.0, 20.0), silence}));
  REQUIRE(one);
  CHECK(std::fabs(*one + 3.01) < 0.05);
  // EBU Tech 3341, case 1: 1 kHz at -23 dBFS in both channels reads -23 LUFS, +-0.1.
  const auto half = sine(1000.0, std::pow(10.0, -23.0 / 20.0), 20.0);
  const auto both = loudness_lufs(sound({half, half}));
  REQUIRE(both);
  CHECK(std::fabs(*both + 23.0) < 0.1);
  const auto none = loudness_lufs(sound({silence, silence}));
  REQUIRE(none);
  CHECK(*none == silence_db);
}

TEST_CASE("peak and mean are told in dBFS, of the worse channel", "[gallery]") {
  auto left = sine(100.0, 0.25, 2.0);
  auto right = sine(100.0, 0.5, 2.0);
  for (double& y : right) {
    y += 0.01;
  }
  const Sound heard = sound({left, right});
  CHECK(std::fabs(peak_dbfs(heard) - 20.0 * std::log10(0.51)) < 1e-9);
  // Under a Hann window of 100 periods a sinusoid leaves nothing: its lobe ends at 2 / 1 s.
  CHECK(std::fabs(dc_dbfs(heard, {0.5, 1.5}) + 40.0) < 1e-9);
  CHECK(dc_dbfs(sound({left}), {0.5, 1.5}) < -150.0);
  CHECK(peak_dbfs(sound({{0.0, 0.0}})) == silence_db);
}

TEST_CASE("two channels correlate as their angle says", "[gallery]") {
  // The same sinusoid a turn of phi apart: correlation cos(phi), mono loss 10 lg(2 / (1 + cos
  // phi)).
  const double phi = std::numbers::pi / 3.0;
  std::vector<double> left(48000);
  std::vector<double> right(48000);
  for (std::size_t n = 0; n < left.size(); ++n) {
    const double phase = 2.0 * std::numbers::pi * 440.0 * static_cast<double>(n) / rate_hz;
    left[n] = std::sin(phase);
    right[n] = std::sin(phase + phi);
  }
  const auto image = stereo_image(sound({left, right}));
  REQUIRE(image);
  CHECK(std::fabs(image->correlation - 0.5) < 1e-9);
  CHECK(std::fabs(image->mono_loss_db - 10.0 * std::log10(2.0 / 1.5)) < 1e-9);
  CHECK_FALSE(stereo_image(sound({left})));
  CHECK_FALSE(stereo_image(sound({left, std::vector<double>(48000)})));
}

TEST_CASE("a decay takes ln(1000) times its time constant", "[gallery]") {
  for (const double decay : {2.0, 20.0}) {
    const Sound heard = sound({sine(1000.0, 0.5, 3.0, decay)});
    const auto t60 = t60_s(heard, {0.0, 3.0});
    REQUIRE(t60);
    CHECK(std::fabs(*t60 * decay / std::log(1000.0) - 1.0) < 1e-3);
  }
  CHECK_FALSE(t60_s(sound({sine(1000.0, 0.5, 3.0)}), {0.0, 3.0}));
  CHECK_FALSE(t60_s(sound({std::vector<double>(48000)}), {0.0, 1.0}));
}

TEST_CASE("an attack lasts until half of the amplitude is there", "[gallery]") {
  // A ramp of 0.2 s; windows of 5 ms end where it has passed half, at 0.1 s.
  auto samples = sine(2000.0, 1.0, 1.0);
  for (std::size_t n = 0; n < samples.size(); ++n) {
    samples[n] *= std::min(1.0, static_cast<double>(n) / (0.2 * rate_hz));
  }
  const auto attack = attack_ms(sound({samples}), {0.0, 1.0});
  REQUIRE(attack);
  CHECK(std::fabs(*attack - 102.5) < 5.0);
  CHECK_FALSE(attack_ms(sound({std::vector<double>(4800)}), {0.0, 0.1}));
}

TEST_CASE("a partial is found to a hundredth of a cent, and a cent off is a cent", "[gallery]") {
  constexpr double key_hz = 220.0;
  for (const double cents : {0.0, 1.0, -7.3}) {
    const double frequency_hz = key_hz * std::exp2(cents / 1200.0);
    auto samples = sine(frequency_hz, 0.1, 3.0, 1.5);
    const auto louder = sine(2.76 * frequency_hz, 0.4, 3.0, 3.0);  // and another one beside it
    for (std::size_t n = 0; n < samples.size(); ++n) {
      samples[n] += louder[n];
    }
    const auto found = partial_near(sound({samples}), {0.02, 3.0}, key_hz, 100.0);
    REQUIRE(found);
    CHECK(std::fabs(cents_between(key_hz, found->frequency_hz) - cents) < 0.01);
  }
  CHECK_FALSE(partial_near(sound({sine(300.0, 0.1, 3.0)}), {0.0, 3.0}, key_hz, 100.0));
}

TEST_CASE("a spectrogram shows a sinusoid at its place, as loud as it is", "[gallery]") {
  const Sound heard = sound({sine(880.0, 0.5, 2.0)});
  const Spectrogram shown = find_spectrogram(heard, {0.0, 2.0}, 109, 20);  // a row a semitone
  const std::size_t row = 60;  // 880 Hz is five octaves above 27.5 Hz
  CHECK(std::fabs(shown.frequency_hz(row) - 880.0) < 1e-6);
  CHECK(std::fabs(shown.at(row, 10) - 20.0 * std::log10(0.5)) < 0.05);
  CHECK(shown.at(row + 12, 10) < -60.0);
  CHECK(shown.at(row - 12, 10) < -60.0);
  const Spectrogram small = made_smaller(shown, 55, 10);
  CHECK(small.at(row / 2, 5) == std::max({shown.at(60, 10), shown.at(60, 11), shown.at(59, 10),
                                          shown.at(59, 11), shown.at(61, 10), shown.at(61, 11)}));
  // The first eight bytes of every PNG, in base64.
  CHECK(to_data_url(shown, -96.0, -16.0).starts_with("data:image/png;base64,iVBORw0KGgo"));
}

TEST_CASE("a page escapes what people wrote", "[gallery]") {
  const std::string page =
      gallery_page({{.name = "a<b>", .description = "x & \"y\"", .failure = "f:1:1: <no>"}}, "now");
  CHECK(page.find("a<b>") == page.npos);
  CHECK(page.find("a&lt;b&gt;") != page.npos);
  CHECK(page.find("x &amp; &quot;y&quot;") != page.npos);
  CHECK(page.find("<no>") == page.npos);
}

}  // namespace ressort::gallery_test
