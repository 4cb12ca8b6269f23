// Output of a recording's modes: the model must parse to the same numbers.
#include "app/commands/body/recording.h"

#include <nlohmann/json.hpp>

#include "core/identification/shapes.h"
#include "tests/support/harness.h"
#include "tests/support/ringing.h"

namespace ressort::recording_text_test {

using namespace support;

namespace {

const std::vector<KnownMode> known = {
    {220.0, 1.0, 0.5, -1.5707963}, {223.0, 0.9, 0.3, 1.5707963}, {910.0, 0.4, 0.2, -1.5707963}};

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
  CHECK(json["modes"][1]["hit"].get<double>() == Approx(body_shapes(found, 40.0)[1].hit));
  CHECK(json["residual_db"].get<double>() < -150.0);
}

TEST_CASE("The figure has a mark and a bar for each mode", "[recording_text]") {
  const Identification found = identified({ringing(known, 1.0)});
  const plot::Figure figure = recording_figure(found, "a <b> & c");
  CHECK(figure.title == "a <b> & c: 3 modes");
  REQUIRE(figure.panels.size() == 3);
  const auto rows_of = [&](std::size_t panel, std::size_t series) {
    const std::string& data = figure.panels[panel].series[series].data;
    return std::count(data.begin(), data.end(), '\n');
  };
  CHECK(rows_of(0, 1) == 3);
  CHECK(rows_of(1, 0) == 3);
  CHECK(rows_of(1, 1) == 3);
  CHECK(plot::to_script(figure).find("NaN") == std::string::npos);
}

}  // namespace ressort::recording_text_test
