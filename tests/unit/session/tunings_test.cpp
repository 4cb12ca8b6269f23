// Tunings from files: beside a preset, from the command line, at the console.
#include "app/session/loader.h"
#include "tests/support/app/console_harness.h"
#include "tests/support/pitch.h"

namespace ressort::tunings_test {
namespace {

const std::string model_text =
    "@s ground 0.\n@m mass 1. 0. 0.\n@r0 spring @s @m 0.01\n"
    "@in1 frcInput @m\n@out1 posOutput @m\n";

std::string preset(const std::string& more) {
  return "model = \"m.mdl\"\n" + more +
         "\n[[control]]\nfrom = \"note\"\nto = \"in1\"\nhow = \"impulse\"\nrange = [0.01, 0.1]\n";
}

// Half octaves.
const std::string two_steps = "two\n2\n600.0\n2/1\n";
const double c_hz = 440.0 * std::exp2(-9.0 / 12.0);

std::string error_of(const std::string& name, const SceneOptions& options = {}) {
  const auto scene = load_scene(name, options);
  return scene ? "" : scene.error().message;
}

}  // namespace

TEST_CASE("a preset's scale is beside it", "[tunings]") {
  const Folder folder;
  folder.write("m.mdl", model_text);
  folder.write("two.scl", two_steps);
  folder.write("map.kbm", "0\n0\n127\n60\n60\n300.0\n0\n");
  const std::string plain = folder.write("plain.toml", preset(""));
  const std::string tuned = folder.write(
      "tuned.toml", preset("scale = \"two.scl\"\nkeyboard_map = \"map.kbm\"\na4_hz = 441"));
  auto scene = load_scene(tuned, {});
  REQUIRE(scene);
  REQUIRE(scene->preset.keys_hz.size() == 128);
  CHECK(scene->preset.keys_hz[61] == Approx(300.0 * std::sqrt(2.0)));
  CHECK(scene->preset.a4_hz == 441.0);
  CHECK(load_scene(plain, {})->preset.keys_hz.empty());
  // Options override it; a keyboard map alone has twelve equal semitones.
  scene = load_scene(tuned, {.keys = {.a4_hz = 415.0, .channels = 4U}});
  CHECK((scene->preset.a4_hz == 415.0 && scene->preset.channels == 4U));
  CHECK(load_scene(plain, {.keys = {.transpose = -5}})->preset.transpose == -5);
  scene = load_scene(plain, {.keys = {.scale = folder.file("two.scl")}});
  CHECK(scene->preset.keys_hz[62] == Approx(2.0 * c_hz));
  scene = load_scene(plain, {.keys = {.keyboard_map = folder.file("map.kbm")}});
  CHECK(scene->preset.keys_hz[62] == Approx(300.0 * std::exp2(2.0 / 12.0)));
  scene = load_scene(folder.file("m.mdl"), {.keys = {.scale = folder.file("two.scl")}});
  CHECK(scene->preset.keys_hz[62] == Approx(2.0 * c_hz));
}

TEST_CASE("a missing or invalid tuning is reported with its file and line", "[tunings]") {
  const Folder folder;
  folder.write("m.mdl", model_text);
  const std::string bad = folder.write("bad.scl", "bad\n2\n600.0\nx\n");
  folder.write("map.kbm", "2\n0\n127\n60\n200\n300.0\n0\n0\nx\n");
  CHECK(has(error_of(folder.write("a.toml", preset("scale = \"none.scl\""))), "none.scl"));
  CHECK(has(error_of(folder.write("b.toml", preset("scale = \"bad.scl\""))),
            bad + ":4:1: error: expected note 2 of 2"));
  CHECK(has(error_of(folder.write("c.toml", preset("keyboard_map = \"map.kbm\""))),
            "map.kbm:5:1: error"));
  CHECK(has(error_of(folder.write("d.toml", preset("scale = \"../bad.scl\""))), "d.toml:2:"));
  CHECK(has(error_of(folder.write("e.toml", preset("scale = \"bad.txt\""))),
            "'scale' must be the name of a .scl file beside the preset"));
}

TEST_CASE("the console tunes the playing scene", "[tunings]") {
  const Folder folder;
  folder.write("m.mdl", model_text);
  const std::string plain = folder.write("plain.toml", preset("a4_hz = 441"));
  const std::string scale = folder.write("two.scl", two_steps);
  const std::string bad = folder.write("bad.scl", "bad\nx\n");
  Harness harness;
  harness.say("load " + plain);
  const auto heard_hz = [&](double guess_hz) {
    std::vector<double> y;
    while (y.size() < 48000) {
      for (const float sample : harness.play()) {
        y.push_back(sample);
      }
    }
    return support::measured_hz(y, 48000.0, guess_hz);
  };
  const auto cents = [](double a_hz, double b_hz) {
    return std::fabs(1200.0 * std::log2(a_hz / b_hz));
  };
  harness.loudest(20);
  harness.say("noteon 61");
  const double equal_hz = 441.0 * std::exp2(-8.0 / 12.0);
  CHECK(cents(heard_hz(equal_hz), equal_hz) < 0.05);
  CHECK(harness.say("tuning " + scale).empty());
  harness.play();
  const double half_hz = 441.0 / 440.0 * c_hz * std::sqrt(2.0);
  CHECK(cents(heard_hz(half_hz), half_hz) < 0.05);
  CHECK(has(harness.say("tuning " + bad), "bad.scl:2:1: error: expected how many notes"));
  CHECK(has(harness.say("tuning nothing"), "expected a scale, NAME.scl"));
  CHECK(cents(heard_hz(half_hz), half_hz) < 0.05);
  harness.say("tuning off");
  harness.play();
  CHECK(cents(heard_hz(equal_hz), equal_hz) < 0.05);
}

}  // namespace ressort::tunings_test
