// Writing presets: edits change values and preserve all other text.
#include "core/model/preset/edit.h"

#include "tests/support/catch.h"
#include "tests/support/rooms.h"

namespace ressort::preset_edit_test {
namespace {

const std::string text =
    "# mine\n"
    "model = \"a.mdl\"   # beside\n"
    "description = \"gr\u00f6\u00dfer\"\n"
    "gain = 2.0\n"
    "voices = 3\n"
    "\n"
    "[parameters]\n"
    "K = { value = 0.1, range = [0.01, 0.2] } # \u00e4\n"
    "\"Z\u00fc\" = { range = [0, 1], value = 0 }\n"
    "\n"
    "[[control]]\n"
    "from = \"cc1\"\n"
    "to = \"K\"\n"
    "range = [\n  0.01, 0.2]\n"
    "\n"
    "[[control]]\n"
    "from = \"note\"\n"
    "to = \"in1\"\n"
    "how = \"impulse\"";

std::string edited(const PresetChanges& changes) {
  const auto result = edit_preset(text, changes);
  INFO((result ? "" : result.error().message));
  REQUIRE(result);
  return *result;
}

std::string replaced(std::string all, const std::string& what, const std::string& by) {
  const std::size_t at = all.find(what);
  REQUIRE(at != all.npos);
  return all.replace(at, what.size(), by);
}

}  // namespace

TEST_CASE("unchanged text is preserved byte for byte", "[preset_edit]") {
  CHECK(edited({.model = "a.mdl", .gain = 2.0}) == text);
}

TEST_CASE("edits replace values and keep comments", "[preset_edit]") {
  const std::string all =
      edited({.model = "/tmp/\"b\".mdl",
              .gain = 3.5,
              .parameters = {{"K", 0.15, 0.01, 0.2}, {"Z\u00fc", 0.5, 0.0, 1.0}}});
  std::string wanted = replaced(text, "\"a.mdl\"", "\"/tmp/\\\"b\\\".mdl\"");
  wanted = replaced(wanted, "gain = 2.0", "gain = 3.5");
  wanted = replaced(wanted, "value = 0.1,", "value = 0.15,");
  CHECK(all == replaced(wanted, "value = 0 }", "value = 0.5 }"));
}

TEST_CASE("a turned knob keeps its effect on a curve", "[preset_edit]") {
  const std::string curved =
      "model = \"a.mdl\"\ngain = 1.0\n[parameters]\n"
      "K = { value = 0.1, range = [0.01, 1], keys = [[21, 0.1], [90, 0.2]] }\n";
  const auto once = edit_preset(curved, {"a.mdl", 1.0, {{"K", 0.2, 0.01, 1.0}}, {}});
  REQUIRE(once);
  CHECK(*once == replaced(curved, "value = 0.1,", "value = 0.2, keys_at = 0.1,"));
  const auto twice = edit_preset(*once, {"a.mdl", 1.0, {{"K", 0.3, 0.01, 1.0}}, {}});
  REQUIRE(twice);
  CHECK(*twice == replaced(curved, "value = 0.1,", "value = 0.3, keys_at = 0.1,"));
}

TEST_CASE("a new parameter is added after the others", "[preset_edit]") {
  const std::string all =
      edited({.model = "a.mdl", .gain = 2.0, .parameters = {{"M", 1.0, 0.5, 2.0}}});
  CHECK(all == replaced(text, "[parameters]\n",
                        "[parameters]\nM = { value = 1.0, range = [0.5, 2.0] }\n"));
}

TEST_CASE("models of 'through' are renamed one by one", "[preset_edit]") {
  const std::string two =
      "model = \"a.mdl\"\nthrough = [\n  \"b.mdl\",  # a box\n  \"c.mdl\"]\n"
      "gain = 2.0\n";
  const auto moved =
      edit_preset(two, {.model = "a.mdl", .gain = 2.0, .through = {"/x/b.mdl", "c.mdl"}});
  REQUIRE(moved);
  CHECK(*moved == replaced(two, "b.mdl", "/x/b.mdl"));
}

TEST_CASE("a missing gain is added, and a text that is not a preset is rejected", "[preset_edit]") {
  const auto short_one = edit_preset("model = \"a.mdl\"", {.model = "a.mdl", .gain = 0.5});
  REQUIRE(short_one);
  CHECK(*short_one == "model = \"a.mdl\"\ngain = 0.5\n");
  CHECK_FALSE(edit_preset("model = 1", {.model = "a.mdl"}));
  CHECK_FALSE(edit_preset("[[", {.model = "a.mdl"}));
}

TEST_CASE("a printed preset reads back unchanged", "[preset_edit]") {
  Preset preset{
      .model = "b.mdl", .description = "a \"b\" \\", .voices = 4, .gain = 12.0, .damper_s = 0.3};
  preset.transpose = -12;
  preset.parameters = {{"K", 0.1, 0.01, 0.2}};
  preset.controls = {{.source = ControlSource::note,
                      .target = "in1",
                      .gesture = Gesture::pluck,
                      .low = 0.3,
                      .high = 0.05,
                      .travel = 2.0,
                      .has_level = true,
                      .low_db = -26.0,
                      .high_db = 1.5,
                      .lowest_key = 20,
                      .highest_key = 90},
                     {.source = ControlSource::note,
                      .target = "in2",
                      .gesture = Gesture::impulse,
                      .longest_ms = 4.0,
                      .shortest_ms = 0.5},
                     {.source = ControlSource::release,
                      .target = "in2",
                      .gesture = Gesture::noise,
                      .longest_ms = 90.0,
                      .shortest_ms = 70.0,
                      .low_hz = 40.0,
                      .high_hz = 400.0},
                     {.target = "in3", .gesture = Gesture::bow, .noise = 0.05},
                     {.source = ControlSource::audio, .number = 2, .target = "in2"},
                     {.source = ControlSource::osc,
                      .address = "/f",
                      .target = "K",
                      .gesture = Gesture::parameter,
                      .low = 0.01,
                      .high = 0.2,
                      .exponential = true}};
  ParsedPreset read = parse_preset(print_preset(preset));
  REQUIRE(read.ok());
  for (ControlSetting& control : read.preset.controls) {
    control.location = {};
  }
  for (ParameterSetting& parameter : read.preset.parameters) {
    parameter.location = {};
  }
  for (ControlSetting& control : preset.controls) {
    control.location = {};
  }
  preset.parameters[0].location = {};
  CHECK(read.preset == preset);
}

}  // namespace ressort::preset_edit_test
