// The figures of a sound, against values known by hand or by a standard.
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

TEST_CASE("Loudness follows BS.1770 and EBU Tech 3341", "[gallery]") {
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

TEST_CASE("The peak is that of the louder channel", "[gallery]") {
  const Sound heard = sound({sine(100.0, 0.25, 2.0), sine(100.0, 0.5, 2.0)});
  CHECK(std::fabs(to_dbfs(peak_of(heard)) - 20.0 * std::log10(0.5)) < 1e-9);
  CHECK(to_dbfs(peak_of(sound({{0.0, 0.0}}))) == silence_db);
}

TEST_CASE("T60 is ln(1000) times the time constant", "[gallery]") {
  for (const double decay : {2.0, 20.0}) {
    const Sound heard = sound({sine(1000.0, 0.5, 3.0, decay)});
    const auto t60 = t60_s(heard, {0.0, 3.0});
    REQUIRE(t60);
    CHECK(std::fabs(*t60 * decay / std::log(1000.0) - 1.0) < 1e-3);
  }
  CHECK_FALSE(t60_s(sound({sine(1000.0, 0.5, 3.0)}), {0.0, 3.0}));
  CHECK_FALSE(t60_s(sound({std::vector<double>(48000)}), {0.0, 1.0}));
}

TEST_CASE("The attack lasts until half of the amplitude", "[gallery]") {
  // A ramp of 0.2 s; in windows of 5 ms, it passes half at 0.1 s.
  auto samples = sine(2000.0, 1.0, 1.0);
  for (std::size_t n = 0; n < samples.size(); ++n) {
    samples[n] *= std::min(1.0, static_cast<double>(n) / (0.2 * rate_hz));
  }
  const auto attack = attack_ms(sound({samples}), {0.0, 1.0});
  REQUIRE(attack);
  CHECK(std::fabs(*attack - 102.5) < 5.0);
  CHECK_FALSE(attack_ms(sound({std::vector<double>(4800)}), {0.0, 0.1}));
}

TEST_CASE("A spectrogram shows the frequency and the level of a sinusoid", "[gallery]") {
  const Sound heard = sound({sine(880.0, 0.5, 2.0)});
  const Spectrogram shown = find_spectrogram(heard, {0.0, 2.0}, 109, 20);  // one row per semitone
  const std::size_t row = 60;  // 880 Hz is five octaves above 27.5 Hz
  CHECK(std::fabs(shown.frequency_hz(row) - 880.0) < 1e-6);
  CHECK(std::fabs(shown.at(row, 10) - 20.0 * std::log10(0.5)) < 0.05);
  CHECK(shown.at(row + 12, 10) < -60.0);
  CHECK(shown.at(row - 12, 10) < -60.0);
  const Spectrogram small = downsampled(shown, 55, 10);
  CHECK(small.at(row / 2, 5) == std::max({shown.at(60, 10), shown.at(60, 11), shown.at(59, 10),
                                          shown.at(59, 11), shown.at(61, 10), shown.at(61, 11)}));
}

TEST_CASE("The page escapes names, descriptions and errors", "[gallery]") {
  const std::string page =
      gallery_page({{.name = "a<b>", .description = "x & \"y\"", .failure = "f:1:1: <no>"}}, "now");
  CHECK(page.find("a<b>") == page.npos);
  CHECK(page.find("a&lt;b&gt;") != page.npos);
  CHECK(page.find("x &amp; &quot;y&quot;") != page.npos);
  CHECK(page.find("<no>") == page.npos);
}

TEST_CASE("The figure of a preset has a cell for each time and pitch and a dot for each note",
          "[gallery]") {
  ShownPreset preset{.name = "a 'b'"};
  preset.notes = {{{0.5, 1.0, 69}, 440.0}, {{1.0, 1.5, 0}, 8.2}};  // the second is below the axis
  preset.peaks_dbfs = {-6.0, -200.0};
  preset.levels_dbfs = {-9.0, -200.0};
  preset.spectrogram = {.from_s = 0.0, .to_s = 2.0, .rows = 2, .columns = 3};
  preset.spectrogram.dbfs = {-200.0, -20.0, -30.0, -40.0, -50.0, -60.0};
  const std::string script = plot::to_script(preset_figure(preset));
  CHECK(script.find("\n-96 -20 -30 \n-40 -50 -60 \n") != script.npos);
  CHECK(script.find("\n0.5 8.78136\nEOD") != script.npos);  // log2(440)
  CHECK(script.find("-200") == script.npos);
  CHECK(plot::to_script(gallery_figure({preset})).find("set title 'a ''b'''") != script.npos);
}

}  // namespace ressort::gallery_test
