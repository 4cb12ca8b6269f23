// Descriptions of files compared with their definitions, and of modes in closed form compared with
// renders.
#include "app/commands/timbre/description.h"

#include <cmath>
#include <limits>
#include <numbers>

#include "app/commands/offline.h"
#include "app/session/loader.h"
#include "app/session/sound_file.h"
#include "core/analysis/modes/modes.h"
#include "tests/support/app/data_folder.h"
#include "tests/support/catch.h"
#include "tests/support/rooms.h"

namespace ressort::description_test {
namespace {

constexpr double rate = 48000.0;

std::string write_sound(const Folder& folder, const std::string& name,
                        const std::vector<std::vector<double>>& channels) {
  const std::string path = folder.file(name);
  auto file = SoundWriter::open(path,
                                {.rate_hz = rate,
                                 .channels = static_cast<int>(channels.size()),
                                 .samples = SampleFormat::float64},
                                Existing::replace);
  REQUIRE(file);
  std::vector<double> interleaved;
  for (std::size_t n = 0; n < channels[0].size(); ++n) {
    for (const auto& channel : channels) {
      interleaved.push_back(channel[n]);
    }
  }
  REQUIRE(file->write(interleaved.data(), channels[0].size()));
  REQUIRE(file->close());
  return path;
}

Description described(const std::string& path, const DescriptionOptions& options = {}) {
  auto description = describe_sound(path, options, [](double) { return true; });
  REQUIRE(description);
  return *std::move(description);
}

double value(const FigureValues& values, std::string_view name) {
  REQUIRE(values[figure_number(name)]);
  return *values[figure_number(name)];
}

std::vector<double> bell() {
  const double modes[][3] = {{220.0, 2.0, 1.0},
                             {441.5, 1.2, 0.6},
                             {667.0, 0.8, 0.4},
                             {1210.0, 0.4, 0.3},
                             {2903.0, 0.15, 0.2}};
  std::vector<double> sound(60000);
  for (const auto& [f, t60, a] : modes) {
    for (std::size_t n = 0; n < sound.size(); ++n) {
      const double t = static_cast<double>(n) / rate;
      sound[n] +=
          a * std::exp(-std::log(1000.0) * t / t60) * std::sin(2.0 * std::numbers::pi * f * t);
    }
  }
  return sound;
}

}  // namespace

TEST_CASE("A frame has the same figures alone and among all frames", "[description]") {
  const Folder folder;
  const std::vector<double> sound = bell();
  const std::string path = write_sound(folder, "bell.wav", {sound});
  const auto near = [](double number) { return Approx(number).epsilon(1e-6); };
  const auto first = described(path, {.at = 0});
  REQUIRE(first.frames.size() == 1);
  CHECK(value(first.frames[0].values, "centroid_hz") == near(555.519845));
  CHECK(value(first.frames[0].values, "spread_hz") == near(566.711753));
  CHECK_FALSE(first.frames[0].values[figure_number("flux")]);
  CHECK_FALSE(first.temporal);
  const auto later = described(path, {.kind = SpectrumKind::power, .at = 24000});
  CHECK(value(later.frames[0].values, "centroid_hz") == near(227.319045));
  CHECK(value(later.frames[0].values, "spread_hz") == near(42.6790185));

  // All frames, one per hop, each equal to the description of that frame alone.
  const auto all = described(path, {.hop = 1000, .f0_hz = 220.0});
  CHECK(all.frames.size() == (60000 - 2048) / 1000 + 1);
  const auto alone = described(path, {.hop = 1000, .at = 24000, .f0_hz = 220.0});
  CHECK(all.frames[24].at == 24000);
  for (std::size_t i = 0; i < timbre_figures().size(); ++i) {
    INFO(timbre_figures()[i].name);
    REQUIRE(all.frames[24].values[i].has_value() == alone.frames[0].values[i].has_value());
    if (all.frames[24].values[i]) {
      CHECK(*all.frames[24].values[i] == *alone.frames[0].values[i]);
    }
  }
  CHECK(described(path, {.hop = 100000}).frames.size() == 1);
}

TEST_CASE("Channels are averaged", "[description]") {
  const Folder folder;
  const std::vector<double> sound = bell();
  std::vector<double> twice = sound;
  for (double& sample : twice) {
    sample *= 2.0;
  }
  const auto two = described(
      write_sound(folder, "two.wav", {twice, std::vector<double>(sound.size())}), {.at = 1000});
  const auto one = described(write_sound(folder, "one.wav", {sound}), {.at = 1000});
  CHECK(two.channels == 2);
  CHECK(value(two.frames[0].values, "rms") == value(one.frames[0].values, "rms"));
}

TEST_CASE("Attack and decay of a file are those of its envelope", "[description]") {
  const Folder folder;
  std::vector<double> sound;
  for (int n = 0; n < 96000; ++n) {
    const double a = n < 480 ? n / 480.0 : std::exp(-std::log(1000.0) * (n - 480) / rate);
    sound.push_back(0.5 * a * std::sin(2.0 * std::numbers::pi * 440.0 * n / rate));
  }
  const auto note = described(write_sound(folder, "note.wav", {sound}));
  REQUIRE(note.temporal);
  CHECK(note.temporal->temporal_centroid_s == Approx(0.1498184).margin(3e-4));
  CHECK(note.temporal->effective_duration_s == Approx(0.1386458).margin(5e-3));
  CHECK(*note.f0_hz == Approx(440.0).epsilon(1e-4));
  // The median excludes frames 60 dB below the loudest: half of this sound.
  const auto statistics = statistics_of(note);
  CHECK(value(statistics.median, "rms") > 1e-3);
  CHECK(value(statistics.median, "centroid_hz") == Approx(440.0).epsilon(5e-3));
}

TEST_CASE("Sounds that cannot be described give errors", "[description]") {
  const Folder folder;
  const auto complaint = [&](const std::vector<double>& sound, const DescriptionOptions& options) {
    const auto description =
        describe_sound(write_sound(folder, "x.wav", {sound}), options, [](double) { return true; });
    REQUIRE_FALSE(description);
    return description.error().message;
  };
  const auto has = [](const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos;
  };
  CHECK(has(complaint(std::vector<double>(100), {}), "has 100 samples, less than a frame of 2048"));
  CHECK(has(complaint(std::vector<double>(4000), {.at = 2000}), "at 2000 is not within the sound"));
  std::vector<double> odd(4000);
  odd[3000] = std::numeric_limits<double>::quiet_NaN();
  CHECK(has(complaint(odd, {}), "sample 3000 is not a number"));
  CHECK_FALSE(describe_sound(folder.file("none.wav"), {}, [](double) { return true; }));
  const auto stopped = describe_sound(write_sound(folder, "x.wav", {bell()}), {},
                                      [](double share) { return share < 0.6; });
  REQUIRE_FALSE(stopped);
  CHECK(stopped.error().message == description_stopped);
  // Frames of silence have no figures.
  const auto silence = described(write_sound(folder, "x.wav", {std::vector<double>(5000)}));
  CHECK(silence.frames.size() == 6);
  CHECK_FALSE(silence.temporal);
  CHECK_FALSE(silence.f0_hz);
  CHECK_FALSE(statistics_of(silence).median[figure_number("centroid_hz")]);
}

TEST_CASE("Modes in closed form have the figures of the render", "[description]") {
  const Folder folder;
  const std::string model = folder.write("string.mdl",
                                         "@s string 40 1. 0.1 0.0005 0. 0.\n"
                                         "@in1 frcInput [@s 0.3]\n@out1 posOutput [@s 0.71]\n");
  const std::string score = folder.write("hit.txt", "0 /in/1/force 1\n");
  const std::string sound = folder.file("hit.wav");
  REQUIRE(render({.name = model,
                  .output = sound,
                  .rate_hz = rate,
                  .seconds = 1.5,
                  .score = score,
                  .format = SampleFormat::float64},
                 [](double) { return true; }));
  const auto scene = load_scene(model, {.bare = true});
  REQUIRE(scene);
  const auto modes = find_modes(scene->network, {}, {.rate_hz = rate});
  REQUIRE(modes);
  for (const long long at : {0, 10000, 40000}) {
    for (const auto kind : {SpectrumKind::magnitude, SpectrumKind::power}) {
      const DescriptionOptions options{.frame = 8192, .kind = kind, .at = at, .f0_hz = 178.7};
      const auto closed = describe_modes(*modes, options);
      REQUIRE(closed);
      const FigureValues& lines = closed->frames.at(0).values;
      const FigureValues bins = described(sound, options).frames.at(0).values;
      const bool is_power = kind == SpectrumKind::power;
      INFO("at " << at << (is_power ? ", power" : ", magnitude"));
      CHECK(value(lines, "rms") == Approx(value(bins, "rms")).epsilon(0.01));
      CHECK(value(lines, "centroid_hz") ==
            Approx(value(bins, "centroid_hz")).epsilon(is_power ? 0.0014 : 0.03));
      CHECK(value(lines, "spread_hz") ==
            Approx(value(bins, "spread_hz")).epsilon(is_power ? 0.01 : 0.05));
      CHECK(value(lines, "inharmonicity") == Approx(value(bins, "inharmonicity")).epsilon(0.01));
      CHECK(value(lines, "tristimulus") == Approx(value(bins, "tristimulus")).epsilon(0.01));
    }
  }
}

}  // namespace ressort::description_test
