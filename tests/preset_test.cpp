// Presets: what is read from one, every complaint with its place, and the preset of no preset.
#include "core/model/preset.h"

#include "tests/rig.h"

namespace ressort {
namespace {

using rig::network_of;

struct Complaint {
  std::string text;
  int line;
  int column;
  std::string message;  // its beginning
};

void check_error(const Complaint& complaint) {
  const auto preset = parse_preset(complaint.text);
  INFO(complaint.text);
  REQUIRE_FALSE(preset);
  INFO(preset.error().message);
  CHECK(preset.error().message.starts_with(complaint.message));
  CHECK(preset.error().line == complaint.line);
  CHECK(preset.error().column == complaint.column);
}

// A preset whose only control is this; the control's keys stand in line 3.
std::string control(const std::string& keys) {
  return "model = \"x.mdl\"\n[[control]]\n" + keys + "\n";
}

ControlSetting control_of(const std::string& keys) {
  const auto preset = parse_preset(control(keys));
  INFO(keys << (preset ? "" : ": " + preset.error().message));
  REQUIRE(preset);
  REQUIRE(preset->controls.size() == 1);
  return preset->controls[0];
}

}  // namespace

TEST_CASE("a preset is what was written, and the rest its defaults", "[preset]") {
  const auto read = parse_preset(
      "model = \"PolyTriangle.mdl\"\n"
      "description = \"three masses\"\n"
      "voices = 12\n"
      "gain = 0.5\n"
      "release_s = 0.25\n"
      "noise = true\n"
      "tuning = \"fixed\"\n"
      "transpose = -12\n"
      "[parameters]\n"
      "m_Z = { value = 1e-4, range = [0.00001, 0.01] }\n"
      "m_K = { value = 0.1, range = [0.0001, 1] }\n"
      "[[control]]\n"
      "from = \"note\"\n"
      "to = \"in1\"\n"
      "how = \"impulse\"\n"
      "range = [0.01, 0.1]\n"
      "keys = [36, 60]\n"
      "[[control]]\n"
      "from = \"cc1\"\n"
      "to = \"m_K\"\n"
      "range = [0.01, 0.3]\n"
      "curve = \"exponential\"\n");
  REQUIRE(read);
  CHECK(read->model == "PolyTriangle.mdl");
  CHECK(read->description == "three masses");
  CHECK(read->voices == 12);
  CHECK(read->gain == 0.5);
  CHECK(read->release_s == 0.25);
  CHECK(read->noise);
  CHECK_FALSE(read->keyboard);
  CHECK(read->transpose == -12);
  REQUIRE(read->parameters.size() == 2);
  CHECK(read->parameters[0] == ParameterSetting{"m_K", 0.1, 0.0001, 1.0});
  CHECK(read->parameters[1] == ParameterSetting{"m_Z", 1e-4, 0.00001, 0.01});
  REQUIRE(read->controls.size() == 2);
  CHECK(read->controls[0] == ControlSetting{.target = "in1",
                                            .gesture = ControlGesture::impulse,
                                            .low = 0.01,
                                            .high = 0.1,
                                            .lowest_key = 36,
                                            .highest_key = 60});
  CHECK(read->controls[1] == ControlSetting{.source = ControlSource::controller,
                                            .number = 1,
                                            .target = "m_K",
                                            .gesture = ControlGesture::parameter,
                                            .low = 0.01,
                                            .high = 0.3,
                                            .exponential = true});
  const auto least = parse_preset("model = \"x.mdl\"");
  REQUIRE(least);
  CHECK(*least == Preset{.model = "x.mdl"});
}

TEST_CASE("every source and every gesture has its word", "[preset]") {
  const auto from = [](const std::string& word) {
    return control_of("from = \"" + word + "\"\nto = \"in1\"");
  };
  CHECK(from("note").source == ControlSource::note);
  CHECK(from("pressure").source == ControlSource::pressure);
  CHECK(from("cc0").number == 0);
  CHECK(from("cc119").source == ControlSource::controller);
  CHECK(from("cc119").number == 119);
  CHECK(from("audio1").source == ControlSource::audio);
  CHECK(from("audio64").number == 64);
  CHECK(from("/finger").source == ControlSource::osc);
  CHECK(from("/finger").address == "/finger");
  const auto how = [](const std::string& word) {
    return control_of("from = \"note\"\nto = \"in1\"\ntravel = 1\nhow = \"" + word + "\"").gesture;
  };
  CHECK(how("position") == ControlGesture::position);
  CHECK(how("pluck") == ControlGesture::pluck);
  CHECK(how("bow") == ControlGesture::bow);
  CHECK(how("impulse") == ControlGesture::impulse);
  CHECK(how("hold") == ControlGesture::hold);
  CHECK(how("parameter") == ControlGesture::parameter);
  // Without a word the target tells.
  CHECK(from("note").gesture == ControlGesture::position);
  CHECK(control_of("from = \"cc1\"\nto = \"m_K\"").gesture == ControlGesture::parameter);
  CHECK(control_of("from = \"cc1\"\nto = \"inner\"").gesture == ControlGesture::parameter);
}

TEST_CASE("every fault of a preset is told with its line and column", "[preset]") {
  const std::string m = "model = \"x.mdl\"\n";
  const std::string to = "to = \"in1\"\n";
  const std::vector<Complaint> complaints = {
      {"", 1, 1, "a preset needs a model"},
      {"voices = 2", 1, 1, "a preset needs a model"},
      {m + "  voice = 2", 2, 11, "unknown key 'voice' in a preset; there are model, "},
      {m + "voices = \"two\"", 2, 10, "'voices' must be a number"},
      {m + "voices = true", 2, 10, "'voices' must be a number"},
      {m + "voices = 0", 2, 10, "'voices' must lie between 1 and 256"},
      {m + "voices = 257", 2, 10, "'voices' must lie between 1 and 256"},
      {m + "voices = 1.5", 2, 10, "'voices' must be a whole number"},
      {m + "gain = -1", 2, 8, "'gain' must lie between 0 and 1e+09"},
      {m + "gain = nan", 2, 8, "'gain' must be a number"},
      {m + "gain = inf", 2, 8, "'gain' must be a number"},
      {m + "release_s = 61", 2, 13, "'release_s' must lie between 0 and 60"},
      {m + "noise = 1", 2, 9, "'noise' must be true or false"},
      {m + "tuning = \"odd\"", 2, 10, "'tuning' must be keyboard or fixed"},
      {m + "transpose = 97", 2, 13, "'transpose' must lie between -96 and 96"},
      {"model = 7", 1, 9, "'model' must be a text in quotes"},
      {m + "parameters = 3", 2, 14, "'parameters' must be a table"},
      {m + "[parameters]\nK = 0.1", 3, 5, "'K' must be a table: { value = 0.1, range = "},
      {m + "[parameters]\nK = { value = 1 }", 3, 5, "'K' needs a value and a range"},
      {m + "[parameters]\nK = { range = [0, 1] }", 3, 5, "'K' needs a value and a range"},
      {m + "[parameters]\nK = { value = 2, range = [0, 1] }", 3, 5,
       "the value of 'K' lies outside its range"},
      {m + "[parameters]\nK = { value = 1, range = [0, 1], unit = 1 }", 3, 41,
       "unknown key 'unit' in the parameter 'K'; there are value, range"},
      {m + "[parameters]\nK = { value = 1, range = 3 }", 3, 26,
       "'range' must be two numbers: [low, high]"},
      {m + "[parameters]\nK = { value = 1, range = [0, 1, 2] }", 3, 26,
       "'range' must be two numbers: [low, high]"},
      {m + "[parameters]\nK = { value = 1, range = [0, \"x\"] }", 3, 30,
       "'range' must be a number"},
      {m + "control = 1", 2, 11, "controls are written one by one: [[control]]"},
      {control("form = \"note\""), 3, 8, "unknown key 'form' in a control; there are from, to"},
      {control(to), 2, 1, "'from' must be \"note\""},
      {control(to + "from = \"cc120\""), 4, 8, "'from' must be \"note\""},
      {control(to + "from = \"cc-1\""), 4, 8, "'from' must be \"note\""},
      {control(to + "from = \"audio0\""), 4, 8, "'from' must be \"note\""},
      {control(to + "from = \"/\""), 4, 8, "'from' must be \"note\""},
      {control("from = \"note\""), 2, 1, "a control needs 'to'"},
      {control(to + "from = \"note\"\nhow = \"slap\""), 5, 7,
       "'how' must be position, pluck, bow, impulse, hold or parameter"},
      {control(to + "from = \"note\"\nhow = \"pluck\""), 2, 1, "a pluck needs 'travel'"},
      {control(to + "from = \"note\"\ncurve = \"round\""), 5, 9,
       "'curve' must be linear or exponential"},
      {control(to + "from = \"note\"\ncurve = \"exponential\""), 2, 1,
       "an exponential curve needs a range above 0"},
      {control(to + "from = \"note\"\ntravel = -1"), 5, 10, "'travel' must lie between 0 and"},
  };
  for (const Complaint& complaint : complaints) {
    check_error(complaint);
  }
}

TEST_CASE("what is no TOML is told with its place, and nothing throws", "[preset]") {
  for (const std::string text : {"model = ", "model = \"x", "[parameters",
                                 "model = \"x\"\nmodel = \"y\"", "= 3", "\xff\xfe", "a = [1, 2"}) {
    const auto preset = parse_preset(text);
    INFO(text);
    REQUIRE_FALSE(preset);
    CHECK(preset.error().line >= 1);
    CHECK(preset.error().column >= 1);
    CHECK_FALSE(preset.error().message.empty());
  }
  check_error({std::string(max_preset_bytes + 1, ' '), 1, 1, "the preset is longer than 1 MiB"});
  const auto second = parse_preset("model = \"x\"\nvoices = = 3");
  REQUIRE_FALSE(second);
  CHECK(second.error().line == 2);
  // Text that no person wrote.
  rig::Random random(12);
  const std::string good = control("from = \"note\"\nto = \"in1\"\nrange = [0, 1]\nhow = \"hold\"");
  for (int i = 0; i < 3000; ++i) {
    std::string text = good;
    for (std::size_t k = 1 + random.below(4); k-- > 0;) {
      text[random.below(text.size())] = static_cast<char>(random.below(256));
    }
    if (const auto preset = parse_preset(text); !preset) {
      REQUIRE_FALSE(preset.error().message.empty());
    }
  }
}

TEST_CASE("without a preset a model is played by what its links ask for", "[preset]") {
  const Preset struck = default_preset(network_of(scenes::poly_triangle()), false);
  CHECK(struck.keyboard);
  CHECK(struck.gain == 1.0);
  REQUIRE(struck.controls.size() == 1);
  CHECK(struck.controls[0].gesture == ControlGesture::impulse);
  CHECK(struck.controls[0].target == "in1");

  const Preset plucked = default_preset(network_of(scenes::iplay_the_triangle()), false);
  REQUIRE(plucked.controls.size() == 2);  // keys, and the wheel for the hand
  CHECK(plucked.controls[0].source == ControlSource::note);
  CHECK(plucked.controls[0].gesture == ControlGesture::pluck);
  CHECK(plucked.controls[0].travel == Approx(0.05).epsilon(1e-12));  // clear of the pluck's 0.01
  CHECK(plucked.controls[1].source == ControlSource::controller);
  CHECK(plucked.controls[1].number == 1);

  const Preset bowed = default_preset(network_of(scenes::bowed_string()), false);
  REQUIRE(bowed.controls.size() == 1);
  CHECK(bowed.controls[0].gesture == ControlGesture::bow);
  // A bow only sings between a third and all of its scale.
  CHECK(bowed.controls[0].low > 5e-5 / 3);
  CHECK(bowed.controls[0].high < 5e-5);

  const Preset heard = default_preset(network_of(scenes::resonator()), false);
  REQUIRE(heard.controls.size() == 1);
  CHECK(heard.controls[0].source == ControlSource::audio);

  // Every default preset is one that compiles, and the bare one has channel n on input n.
  for (const scenes::Example& example : scenes::nine_instruments()) {
    CAPTURE(example.name);
    const Network network = network_of(example.text);
    CHECK(compile(network, default_preset(network, false), {}));
    const Preset bare = default_preset(network, true);
    CHECK_FALSE(bare.keyboard);
    for (const Input& input : network.inputs) {
      CHECK(std::any_of(bare.controls.begin(), bare.controls.end(), [&](const ControlSetting& c) {
        return c.source == ControlSource::audio && c.number == input.number && c.high == 1.0 &&
               c.target == "in" + std::to_string(input.number);
      }));
    }
  }
}

}  // namespace ressort
