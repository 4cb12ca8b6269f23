// Output of a recording's modes: the model must parse to the same numbers.
#include "app/commands/body/recording.h"

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>

#include "app/commands/output.h"
#include "app/session/compile_scene.h"
#include "app/session/loader.h"
#include "core/identification/shapes.h"
#include "core/identification/spectrum.h"
#include "tests/support/harness.h"
#include "tests/support/player.h"
#include "tests/support/ringing.h"

namespace ressort::recording_text_test {

using namespace support;

namespace {

const std::vector<KnownMode> known = {
    {220.0, 1.0, 0.5, -1.5707963}, {223.0, 0.9, 0.3, 1.5707963}, {910.0, 0.4, 0.2, -1.5707963}};

// Plays the preset of a recording.
class PlayedRecording {
 public:
  PlayedRecording(const Identification& found, const std::vector<NoiseBand>& noise)
      : folder_(TemporaryFolder::make()) {
    REQUIRE(folder_);
    std::ofstream(folder_->file("bowl.mdl"))
        << played_model(found, noise, "bowl", "bowl.wav", 40.0);
    std::ofstream(folder_->file("bowl.toml"))
        << played_preset(found, noise, "bowl", "bowl.mdl", "bowl.wav");
  }
  // Returns the first second of a note.
  std::vector<double> note(int key, double velocity = 1.0) const {
    const auto scene = load_scene(folder_->file("bowl.toml"), {});
    REQUIRE(scene);
    std::vector<std::string> warnings;
    auto compiled = compile_scene(*scene, {.rate_hz = 44100.0}, warnings);
    REQUIRE(compiled);
    Player player(*std::move(compiled));
    player.run(44100, {note_on(0, key, velocity)});
    return player.y();
  }

 private:
  decltype(TemporaryFolder::make()) folder_;
};

}  // namespace

TEST_CASE("A label is made from a file name", "[recording_text]") {
  CHECK(label_of_file("bowl.mdl") == "bowl");
  CHECK(label_of_file("/a/b.c/My bowl-2.wav") == "My_bowl_2");
  CHECK(label_of_file("2nd.wav") == "body_2nd");
  CHECK(label_of_file("\xe9.wav") == "body");
  CHECK(label_of_file(".wav") == "_wav");
}

TEST_CASE("The model renders the recording", "[recording_text]") {
  Random random(1);
  const std::vector<double> sound = ringing(known, 1.0);
  const auto channels = GENERATE(std::size_t{1}, std::size_t{2}, std::size_t{5});
  std::vector<std::vector<double>> all;
  for (std::size_t c = 0; c < channels; ++c) {
    all.push_back(sound);
    for (double& x : all.back()) {
      x *= 1.0 - 0.5 * static_cast<double>(c);
    }
  }
  const Identification found = identified(all);
  const std::string text = body_model(found, "bowl", "hit\n@x mass 1. 0. 0.", 7.5);
  INFO(text);
  Bare<double> body(program_of(text));
  REQUIRE(body.program().outputs.size() == channels);
  Comparison comparison;
  for (std::size_t n = 0; n < sound.size(); ++n) {
    // The engine's first output is one sample after the force.
    const std::vector<double> outputs = body.step({n == 0 ? 1.0 : 0.0});
    for (std::size_t c = 0; c < channels && n + 1 < sound.size(); ++c) {
      comparison.add(all[c][n + 1], outputs[c]);
    }
  }
  CHECK(comparison.relative() < 1e-6);
}

TEST_CASE("The played model renders the recording, and its noise has the measured level",
          "[recording_text]") {
  // The modes start with other phases than from rest, and their sum starts at 0.
  const double phase = std::acos(-(0.5 * std::cos(1.4) + 0.2 * std::cos(1.2)) / 0.3);
  const std::vector<double> sound =
      ringing({{220.0, 1.0, 0.5, -1.4}, {223.0, 0.9, 0.3, phase}, {910.0, 0.4, 0.2, -1.2}}, 1.0);
  const Identification found = identified({sound});
  const std::vector<NoiseBand> noise = {
      {.low_hz = 500.0, .high_hz = 1500.0, .t60_s = 0.1, .level = {0.2}},
      {.low_hz = 1500.0, .high_hz = 5000.0, .t60_s = 0.1, .level = {0.1}}};
  const std::string text = played_model(found, noise, "bowl", "bowl.wav", 40.0);
  INFO(text);
  Bare<double> struck(program_of(text));
  REQUIRE(struck.program().inputs.size() == 3);
  Comparison comparison;
  for (std::size_t n = 0; n + 1 < sound.size(); ++n) {
    comparison.add(sound[n + 1], struck.step({n == 0 ? 1.0 : 0.0, 0.0, 0.0})[0]);
  }
  CHECK(comparison.relative() < 1e-3);  // Five digits of each number.
  // The noise gesture's filters: one pole each, rms 1 behind them.
  Random random(7);
  std::vector<std::vector<double>> bursts;
  for (const NoiseBand& band : noise) {
    const double low = std::exp(-2.0 * std::numbers::pi * band.low_hz / 44100.0);
    const double high = std::exp(-2.0 * std::numbers::pi * band.high_hz / 44100.0);
    double below = 0.0;
    double smooth = 0.0;
    double square = 0.0;
    std::vector<double>& burst = bursts.emplace_back(1 << 17);
    for (double& x : burst) {
      smooth = high * smooth + (1.0 - high) * gaussian(random);
      below = low * below + (1.0 - low) * smooth;
      x = smooth - below;
      square += x * x / static_cast<double>(burst.size());
    }
    for (double& x : burst) {
      x /= std::sqrt(square);
    }
  }
  // The bands overlap; together they have the measured level in each band.
  Bare<double> body(program_of(text));
  std::vector<double> heard;
  for (std::size_t n = 0; n < bursts[0].size(); ++n) {
    heard.push_back(body.step({0.0, bursts[0][n], bursts[1][n]})[0]);
  }
  const Power power(std::vector<std::vector<double>>{heard}, heard.size());
  for (const NoiseBand& band : noise) {
    const double hertz = 2.0 * std::numbers::pi / 44100.0;
    // One-pole filters at 5 kHz differ from analog ones, by less than 1 dB here.
    CHECK(std::sqrt(power.between(hertz * band.low_hz, hertz * band.high_hz)) ==
          Approx(band.level[0]).epsilon(0.12));
  }
}

TEST_CASE("The preset names its model, its knobs and a burst for each band", "[recording_text]") {
  const Identification found = identified({ringing(known, 1.0)});
  const std::vector<NoiseBand> noise = {
      {.low_hz = 500.0, .high_hz = 1500.0, .t60_s = 0.1, .level = {0.2}}};
  const std::string text = played_preset(found, noise, "bowl", "bowl.mdl", "bowl.wav");
  CHECK(text.find("model = \"bowl.mdl\"") == 0);
  for (const char* const knob :
       {"mallet = {", "ring = {", "damp = {", "place = {", "to = \"in2\"\nhow = \"noise\""}) {
    INFO(knob);
    CHECK(text.find(knob) != std::string::npos);
  }
  CHECK(text.find("length_ms = [100, 100]") != std::string::npos);
  CHECK(text.find("fixed = [\"bowl_noise\"]") != std::string::npos);
}

TEST_CASE("The preset of a recording plays the fall of its pitch on all keys", "[recording_text]") {
  Identification found = identified({ringing({{220.0, 0.5, 0.5, 0.0}}, 1.0)});
  found.fall = {.cents = {300.0, 1.0}, .decay_s = {0.1, 0.001}};
  const std::vector<NoiseBand> noise = {
      {.low_hz = 14000.0, .high_hz = 20000.0, .t60_s = 0.02, .level = {1e-4}}};
  const PlayedRecording body(found, noise);
  for (const int key : {57, 93}) {  // A3 and A6
    INFO("key " << key);
    const std::vector<double> y = body.note(key, 1.0);
    REQUIRE(peak(y) > 0.01);
    // Upward zero crossings in 50 ms: the mean of 300 cents e^(-t / 0.1 s) over this time.
    const auto cents_at = [&](double time_s) {
      std::vector<double> crossings;
      const auto first = static_cast<std::size_t>(time_s * 44100.0);
      for (std::size_t n = first; n < first + 2205; ++n) {
        if (y[n] < 0.0 && y[n + 1] >= 0.0) {
          crossings.push_back(static_cast<double>(n) + y[n] / (y[n] - y[n + 1]));
        }
      }
      REQUIRE(crossings.size() > 2);
      const double period =
          (crossings.back() - crossings.front()) / static_cast<double>(crossings.size() - 1);
      return 1200.0 * std::log2(44100.0 / period / (220.0 * std::exp2((key - 57) / 12.0)));
    };
    for (const double time_s : {0.1, 0.2}) {
      const double mean = 300.0 * 2.0 * (std::exp(-time_s / 0.1) - std::exp(-time_s / 0.1 - 0.5));
      CHECK(cents_at(time_s) == Approx(mean).margin(3.0));
    }
  }
}

TEST_CASE("The noise of a recording does not depend on the key", "[recording_text]") {
  const Identification found = identified({ringing({{220.0, 0.5, 0.5, 0.0}}, 1.0)});
  const PlayedRecording body(found,
                             {{.low_hz = 3000.0, .high_hz = 5000.0, .t60_s = 0.3, .level = {0.1}}});
  const auto level_db = [&](int key) {
    const std::vector<double> y = body.note(key);
    const Power power(std::vector<std::vector<double>>{y}, y.size());
    const double hertz = 2.0 * std::numbers::pi / 44100.0;
    return 10.0 * std::log10(power.between(3000.0 * hertz, 5000.0 * hertz));
  };
  // Every note has other noise. Retuned by two octaves, the band would lose 12 dB and more.
  CHECK(level_db(81) == Approx(level_db(57)).margin(1.0));
}

TEST_CASE("A played recording has its loudest mode at the key, and no key is louder",
          "[recording_text]") {
  // All modes start with phase 0 or pi, so velocities are heard, which grow with the pitch at equal
  // motion. The loudest mode is at A3, key 57, one octave and 10 cents above the lowest one.
  const double low_hz = 110.0 * std::exp2(-10.0 / 1200.0);
  const Identification found = identified({ringing({{low_hz, 0.5, 0.1, std::numbers::pi},
                                                    {220.0, 0.5, 0.5, 0.0},
                                                    {330.0, 0.4, 0.4, std::numbers::pi}},
                                                   1.0)});
  const PlayedRecording body(found, {});
  const auto peak_at = [&](int key) { return peak(body.note(key)); };
  const double own = peak_at(57);
  CHECK(own > 0.1);
  // Velocities alone have at most the sum of the amplitudes, 1.0 beside a peak of 0.8 or more.
  for (const int key : {69, 81, 93}) {
    INFO("key " << key);
    CHECK(peak_at(key) < 1.3 * own);
  }
  const std::vector<double> y = body.note(57);
  const Power power(std::vector<std::vector<double>>{y}, y.size());
  // A mode with a T60 of 0.5 s has 2 / pi atan(2), 70 %, of its energy within 4.4 Hz.
  const double omega = 2.0 * std::numbers::pi * 220.0 / 44100.0;
  CHECK(power.between(0.98 * omega, 1.02 * omega) > 0.5 * power.between(0.0, 1.2 * omega));
}

TEST_CASE("Recordings from soft to loud are the timbres of low and high velocities",
          "[recording_text]") {
  Identification found =
      identified({ringing({{220.0, 0.5, 0.5, -1.5}, {550.0, 0.4, 0.4, -1.5}}, 1.0)});
  // The soft blow moves the second mode a tenth as much, relative to the first one.
  found.hits = {{0.1, 0.01}, {1.0, 1.0}};
  const PlayedRecording body(found, {});
  // Returns the power of the second mode relative to that of the first one, in dB.
  const auto brightness = [&](double velocity) {
    const std::vector<double> y = body.note(57, velocity);
    const Power power(std::vector<std::vector<double>>{y}, y.size());
    const double hertz = 2.0 * std::numbers::pi / 44100.0;
    return 10.0 * std::log10(power.between(540.0 * hertz, 560.0 * hertz) /
                             power.between(210.0 * hertz, 230.0 * hertz));
  };
  CHECK(brightness(1.0) - brightness(0.001) == Approx(20.0).margin(0.2));
}

TEST_CASE("Numbers are written with their significant digits", "[recording_text]") {
  Random random(2);
  const Identification found = identified({with_noise(ringing(known, 1.0), 1e-3, random)});
  const std::string text = body_model(found, "b", "x", 40.0);
  const std::size_t at = text.find("@b_3 mode @b ") + 13;
  const std::string hertz = text.substr(at, text.find(' ', at) - at);
  const double deviation = found.modes[2].frequency_hz.deviation;
  CHECK(std::fabs(std::stod(hertz) - found.modes[2].frequency_hz.value) < 0.06 * deviation);
  CHECK(hertz.size() <= 9);
}

TEST_CASE("The JSON has the identified modes", "[recording_text]") {
  const Identification found = identified({ringing(known, 1.0)});
  const auto json = nlohmann::json::parse(identification_json(found, 40.0));
  REQUIRE(json["modes"].size() == 3);
  CHECK(json["modes"][1]["frequency_hz"].get<double>() == Approx(223.0));
  CHECK(json["modes"][1]["t60_s"].get<double>() == Approx(0.9));
  CHECK(json["modes"][1]["channels"][0]["displacement"].get<double>() < 0.0);
  CHECK(json["modes"][1]["hit"].get<double>() == Approx(body_shapes(found.modes, 40.0)[1].hit));
  CHECK(json["residual_db"].get<double>() < -150.0);
}

TEST_CASE("The figure has a mark and a bar for each mode", "[recording_text]") {
  const Identification found = identified({ringing(known, 1.0)});
  const plot::Figure figure = recording_figure(found, parts_of(found, {}), "a <b> & c");
  CHECK(figure.title == "a <b> & c: 3 modes");
  REQUIRE(figure.panels.size() == 6);
  const auto rows_of = [&](std::size_t panel, std::size_t series) {
    const std::string& data = figure.panels[panel].series[series].data;
    return std::count(data.begin(), data.end(), '\n');
  };
  CHECK(rows_of(3, 1) == 3);
  CHECK(rows_of(4, 0) == 3);
  CHECK(rows_of(4, 1) == 3);
  CHECK(plot::to_script(figure).find("NaN") == std::string::npos);
}

TEST_CASE("The parts of a recording are written at equal loudness", "[recording_text]") {
  const Identification found = identified({ringing(known, 1.0)});
  const std::vector<NoiseBand> noise = {
      {.low_hz = 1500.0, .high_hz = 5000.0, .t60_s = 1.0, .level = {0.01}}};
  const auto folder = TemporaryFolder::make();
  REQUIRE(folder);
  const std::string path = folder->file("parts");
  REQUIRE(write_parts(path, parts_of(found, noise), false));
  CHECK_FALSE(write_parts(path, parts_of(found, noise), false));
  const auto recording = read_sound(path + "/recording.wav");
  REQUIRE(recording);
  double peak = 0.0;
  for (const char* const name : {"/recording.wav", "/modes.wav", "/noise.wav", "/sum.wav"}) {
    INFO(name);
    const auto sound = read_sound(path + name);
    REQUIRE(sound);
    CHECK(*loudness_lufs(*sound) == Approx(*loudness_lufs(*recording)).margin(0.1));
    peak = std::max(peak, peak_of(sound->channels[0]));
  }
  CHECK(peak == Approx(0.9).epsilon(1e-6));
}

}  // namespace ressort::recording_text_test
