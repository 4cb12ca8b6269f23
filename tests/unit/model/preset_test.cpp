// Presets: reading, errors with their positions, and the default preset.
#include "core/model/preset/preset.h"

#include "app/control/registry.h"
#include "core/model/preset/fit.h"
#include "tests/support/harness.h"

namespace ressort::preset_test {
namespace {

using support::network_of;

struct Complaint {
  std::string text;
  int line;
  int column;
  std::string message;  // start of the message
};

void check_error(const Complaint& complaint) {
  const auto preset = parse_preset(complaint.text, is_reserved);
  INFO(complaint.text);
  REQUIRE(preset.errors.size() == 1);
  const Error& error = preset.errors[0];
  INFO(error.message);
  CHECK(error.message.starts_with(complaint.message));
  CHECK(error.line == complaint.line);
  CHECK(error.column == complaint.column);
}

// Returns a preset with this control only, whose keys are in line 3.
std::string with_control(const std::string& keys) {
  return "model = \"x.mdl\"\n[[control]]\n" + keys + "\n";
}

ControlSetting control_of(const std::string& keys) {
  const auto preset = parse_preset(with_control(keys), is_reserved);
  INFO(keys << (preset.ok() ? "" : ": " + preset.errors[0].message));
  REQUIRE(preset.ok());
  REQUIRE(preset.preset.controls.size() == 1);
  return preset.preset.controls[0];
}

}  // namespace

TEST_CASE("a preset has the values of its text, and defaults", "[preset]") {
  const auto parsed = parse_preset(
      "model = \"PolyTriangle.mdl\"\n"
      "description = \"three masses\"\n"
      "voices = 12\n"
      "gain = 0.5\n"
      "damper_s = 0.25\n"
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
  REQUIRE(parsed.ok());
  const Preset* const read = &parsed.preset;
  CHECK(read->model == "PolyTriangle.mdl");
  CHECK(read->description == "three masses");
  CHECK(read->voices == 12);
  CHECK(read->gain == 0.5);
  CHECK(read->damper_s == 0.25);
  CHECK(read->noise);
  CHECK_FALSE(read->keyboard);
  CHECK(read->transpose == -12);
  REQUIRE(read->parameters.size() == 2);
  CHECK(read->parameters[0] == ParameterSetting{"m_K", 0.1, 0.0001, 1.0});
  CHECK(read->parameters[1] == ParameterSetting{"m_Z", 1e-4, 0.00001, 0.01});
  REQUIRE(read->controls.size() == 2);
  CHECK(read->controls[0] == ControlSetting{.target = "in1",
                                            .gesture = Gesture::impulse,
                                            .low = 0.01,
                                            .high = 0.1,
                                            .lowest_key = 36,
                                            .highest_key = 60});
  CHECK(read->controls[1] == ControlSetting{.source = ControlSource::controller,
                                            .number = 1,
                                            .target = "m_K",
                                            .gesture = Gesture::parameter,
                                            .low = 0.01,
                                            .high = 0.3,
                                            .exponential = true});
  const auto least = parse_preset("model = \"x.mdl\"");
  REQUIRE(least.ok());
  CHECK(least.preset == Preset{.model = "x.mdl"});
}

TEST_CASE("the keys for tuning and playing are read", "[preset]") {
  const auto parsed = parse_preset(
      "model = \"x.mdl\"\na4_hz = 442.5\nscale = \"a.scl\"\nkeyboard_map = \"a.kbm\"\n"
      "channels = [1, 3, 16]\nvelocity = -0.5\nplay = \"legato\"\nglide_s = 0.25\n");
  REQUIRE(parsed.ok());
  const Preset& read = parsed.preset;
  CHECK(read.a4_hz == 442.5);
  CHECK((read.scale == "a.scl" && read.keyboard_map == "a.kbm"));
  CHECK(read.channels == 0x8005);
  CHECK(read.velocity == -0.5);
  CHECK((read.mono && read.legato));
  CHECK(read.glide_s == 0.25);
  const auto points =
      parse_preset("model = \"x.mdl\"\nvelocity = [[0, 0], [63.5, 127]]\nplay = \"mono\"\n");
  REQUIRE(points.ok());
  CHECK(points.preset.velocity_points == std::vector<CurvePoint>{{0.0, 0.0}, {0.5, 1.0}});
  CHECK((points.preset.mono && !points.preset.legato));
  CHECK(parse_preset("model = \"x.mdl\"\nflattening_cents = [[48, 8], [96, -6.5]]\n")
            .preset.flattening_cents == std::vector<CurvePoint>{{48.0, 8.0}, {96.0, -6.5}});
  CHECK(parse_preset("model = \"x.mdl\"\nflattening_cents = 4\n").preset.flattening_cents ==
        std::vector<CurvePoint>{{0.0, 4.0}});
  CHECK(parse_preset("model = \"x.mdl\"\nkeys_db = [[36, 7], [96, -1.5]]\n").preset.keys_db ==
        std::vector<CurvePoint>{{36.0, 7.0}, {96.0, -1.5}});
  for (const char* const wrong : {"a4_hz = 100",
                                  "keys_db = 41",
                                  "keys_db = [[36, 7], [96, -41]]",
                                  "scale = \"a.kbm\"",
                                  "scale = \"b/a.scl\"",
                                  "keyboard_map = 3",
                                  "channels = []",
                                  "channels = [0]",
                                  "channels = [17]",
                                  "channels = [1.5]",
                                  "channels = 1",
                                  "flattening_cents = 101",
                                  "flattening_cents = [[0, 1]]",
                                  "flattening_cents = [[9, 1], [9, 1]]",
                                  "flattening_cents = [[0, 1], [1, 101]]",
                                  "flattening_cents = [[0, 1], [1]]",
                                  "velocity = 2",
                                  "velocity = [[0, 0]]",
                                  "velocity = [[0, 0], [0, 1]]",
                                  "velocity = [[0, 1], [127, 0]]",
                                  "velocity = [[0, 0], [128, 1]]",
                                  "velocity = [0, 1]",
                                  "velocity = [[0, 0], [true, 1]]",
                                  "play = \"solo\"",
                                  "glide_s = -1"}) {
    CAPTURE(wrong);
    const auto read_wrong = parse_preset("model = \"x.mdl\"\n" + std::string(wrong) + "\n");
    REQUIRE(read_wrong.errors.size() == 1);
    CHECK(read_wrong.errors[0].line == 2);
  }
}

TEST_CASE("all sources and gestures are read", "[preset]") {
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
  CHECK(how("position") == Gesture::position);
  CHECK(how("pluck") == Gesture::pluck);
  CHECK(how("bow") == Gesture::bow);
  CHECK(how("impulse") == Gesture::impulse);
  CHECK(how("hold") == Gesture::hold);
  CHECK(how("parameter") == Gesture::parameter);
  // Without `how` the target determines the gesture.
  CHECK(from("note").gesture == Gesture::position);
  CHECK(control_of("from = \"cc1\"\nto = \"m_K\"").gesture == Gesture::parameter);
  CHECK(control_of("from = \"cc1\"\nto = \"inner\"").gesture == Gesture::parameter);
}

TEST_CASE("noise, releases, LFOs and variation are read", "[preset]") {
  const ControlSetting noise = control_of(
      "from = \"release\"\nto = \"in1\"\nhow = \"noise\"\nlength_ms = [60, 2000]\n"
      "band_hz = [80, 1500]");
  CHECK(noise.source == ControlSource::release);
  CHECK(noise.gesture == Gesture::noise);
  CHECK(noise.shortest_ms == 2000.0);
  CHECK(noise.low_hz == 80.0);
  CHECK(noise.high_hz == 1500.0);
  CHECK(control_of("from = \"note\"\nto = \"in1\"\nhow = \"bow\"\nnoise = 0.05").noise == 0.05);
  const auto read = parse_preset(
      "model = \"x.mdl\"\nvariation = { strength = 0.05, timing_ms = 5 }\n"
      "[[lfo]]\nname = \"slow\"\nshape = \"fall\"\nby = \"level\"\n[[lfo]]\nname = "
      "\"vibrato\"\nrate_hz = 6\ndelay_s = 0.2\n"
      "fade_s = 0.4\nshape = \"random\"\ndepth = 0.5\ndeviation = 0.1\nby = \"cc1\"\n"
      "[[control]]\nfrom = \"vibrato\"\nto = \"pitch\"\nrange = [-10, 10]\n");
  REQUIRE(read.ok());
  CHECK(read.preset.varied_strength == 0.05);
  CHECK(read.preset.varied_ms == 5.0);
  CHECK(read.preset.lfos[0] ==
        LfoSetting{.name = "slow", .lfo = {.shape = LfoShape::fall}, .by = ControlSource::note});
  CHECK(read.preset.lfos[1] == LfoSetting{.name = "vibrato",
                                          .lfo = {.rate_hz = 6.0,
                                                  .delay_s = 0.2,
                                                  .fade_s = 0.4,
                                                  .shape = LfoShape::random,
                                                  .depth = 0.5,
                                                  .deviation = 0.1},
                                          .by = ControlSource::controller,
                                          .number = 1});
  CHECK(read.preset.controls[0].source == ControlSource::lfo);
  CHECK(read.preset.controls[0].number == 1);
}

TEST_CASE("a controller has a name and a help", "[preset]") {
  const ControlSetting named =
      control_of("from = \"cc16\"\nto = \"in1\"\nname = \"Bow pressure\"\nhelp = \"Its force\"");
  CHECK(named.name == "Bow pressure");
  CHECK(named.help == "Its force");
  CHECK(word_of(named.name) == "bow-pressure");
  CHECK(control_of("from = \"cc16\"\nto = \"in1\"").name.empty());
}

TEST_CASE("reserved OSC addresses are rejected", "[preset]") {
  for (const Row* const row : addresses()) {
    std::string address = row->address;
    if (const std::size_t at = address.find("NAME"); at != std::string::npos) {
      address.replace(at, 4, "x");
    }
    if (const std::size_t at = address.find("/N/"); at != std::string::npos) {
      address.replace(at, 3, "/1/");
    }
    check_error({with_control("to = \"in1\"\nfrom = \"" + address + "\""), 4, 8,
                 "'" + address + "' is reserved by ressort"});
  }
  for (const std::string address : {"/a", "/note/onset", "/params/x", "/inner/1", "/a-b_c.d/2!"}) {
    CHECK(control_of("to = \"in1\"\nfrom = \"" + address + "\"").address == address);
  }
  const std::string longest = "/" + std::string(254, 'a');
  CHECK(control_of("to = \"in1\"\nfrom = \"" + longest + "\"").address == longest);
}

TEST_CASE("numbers by key are read", "[preset]") {
  const auto read = parse_preset(
      "model = \"x.mdl\"\ndamper_s = [[21, 0.4], [99, 0.01], [100, 0]]\n"
      "[parameters]\nB = { value = 1, range = [0.5, 9], keys = [[21, 1], [60, 3]], "
      "velocity = [[0, 0.5], [127, 2]], keys_at = 2 }\n"
      "[[control]]\nfrom = \"note\"\nto = \"in1\"\nhow = \"swing\"\nfollows_pitch = false\n"
      "range = { keys = [[40, 1, 2], [80, 3, 6]] }\ntravel = { keys = [[40, 1], [80, 2]] }\n"
      "level_db = { keys = [[40, -30, 0], [80, -20, 4]] }\n"
      "length_ms = { keys = [[20, 5, 4], [60, 3, 2]] }\n");
  INFO((read.ok() ? "" : read.errors[0].message));
  REQUIRE(read.ok());
  const Preset& preset = read.preset;
  CHECK(preset.damper_keys == std::vector<CurvePoint>{{21, 0.4}, {99, 0.01}, {100, 0}});
  CHECK(preset.damper_s == Approx(0.205));
  CHECK(curve_text(preset, "B") == "keys 21: 1, 60: 3 at 2; velocity 0: 0.5, 127: 2");
  const ControlSetting& control = preset.controls[0];
  CHECK_FALSE(control.follows_pitch);
  CHECK(control.low == 2.0);  // on middle C
  CHECK(control.high == 4.0);
  CHECK(curve_keys(control) == std::vector<double>{20, 40, 60, 80});
  const ControlSetting lower = on_key(control, 40);
  CHECK(lower.high == 2.0);
  CHECK(lower.travel == 1.0);
  CHECK(lower.low_db == -30.0);
  CHECK(lower.longest_ms == 4.0);
  CHECK(lower.shortest_ms == 3.0);
}

TEST_CASE("errors in presets have a line and a column", "[preset]") {
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
      {m + "damper_s = 61", 2, 12, "'damper_s' must lie between 0 and 60"},
      {m + "tuning = \"fixed\"\nkeys_db = 3", 3, 11,
       "'keys_db' has no effect with tuning = \"fixed\", where all keys play the same note"},
      {m + "damper_s = [[36, 0], [96, 61]]", 2, 22,
       "a key lies between 0 and 127, its seconds between 0 and 60"},
      {m + "decay_s = 2", 2, 11, "unknown key 'decay_s' in a preset; there are model, "},
      {m + "[[control]]\nfrom = \"note\"\n" + to + "round_robin = [1.5, 2]", 5, 15,
       "'round_robin' must be two whole numbers: [1, 2]"},
      {m + "[[control]]\nfrom = \"note\"\n" + to + "round_robin = [3, 2]", 5, 15,
       "'round_robin' is the wrong way round"},
      {m + "[[control]]\nfrom = \"note\"\n" + to + "round_robin = [0, 2]", 5, 16,
       "'round_robin' must lie between 1 and 16"},
      {m + "[[control]]\nfrom = \"cc1\"\n" + to + "round_robin = [1, 2]", 5, 15,
       "'round_robin' is for notes only"},
      {m + "noise = 1", 2, 9, "'noise' must be true or false"},
      {m + "tuning = \"odd\"", 2, 10, "'tuning' must be keyboard or fixed"},
      {m + "precision = \"single\"", 2, 13, "'precision' must be double or float"},
      {m + "transpose = 97", 2, 13, "'transpose' must lie between -96 and 96"},
      {"model = 7", 1, 9, "'model' must be a text in quotes"},
      {m + "parameters = 3", 2, 14, "'parameters' must be a table"},
      {m + "[parameters]\nK = 0.1", 3, 5, "'K' must be a table: { value = 0.1, range = "},
      {m + "[parameters]\nK = { value = 1 }", 3, 5, "'K' needs a value and a range"},
      {m + "[parameters]\nK = { range = [0, 1] }", 3, 5, "'K' needs a value and a range"},
      {m + "[parameters]\nK = { value = 2, range = [0, 1] }", 3, 5,
       "the value of 'K' lies outside its range"},
      {m + "[parameters]\nK = { value = 0.5, range = [1, 0] }", 3, 28,
       "'range' is the wrong way round: write the lower number first, [low, high]"},
      {m + "[parameters]\nK = { value = 1, range = [0, 1], unit = 1 }", 3, 41,
       "unknown key 'unit' in the parameter 'K'; there are value, range, keys, "
       "velocity, keys_at"},
      {m + "[parameters]\nK = { value = 1, range = [1, 2], keys = [[21, 1], [60, 2.5]] }", 3, 51,
       "a key lies between 0 and 127, and its value in the range of 'K', 1 to 2"},
      {m + "[parameters]\nK = { value = 1, range = [1, 2], keys = [[60, 1], [21, 2]] }", 3, 51,
       "the points of 'keys' must ascend"},
      {m + "[parameters]\nK = { value = 1, range = [1, 2], velocity = [[0, 0], [127, 1]] }", 3, 46,
       "a velocity lies between 0 and 127, its factor between 1e-6 and 1e6"},
      {m + "[parameters]\nK = { value = 1, range = [1, 2], keys_at = 1 }", 3, 44,
       "'keys_at' needs 'keys'"},
      {m + "tuning = \"fixed\"\n[parameters]\nK = { value = 1, range = [1, 2], "
           "keys = [[21, 1], [60, 2]] }",
       4, 41, "'keys' has no effect with tuning = \"fixed\""},
      {m + "[[control]]\nfrom = \"cc1\"\n" + to + "range = { keys = [[21, 0, 1], [60, 0, 2]] }", 5,
       9, "'range' can differ from key to key only for notes"},
      {m + "[[control]]\nfrom = \"note\"\n" + to + "range = { keys = [[21, 0], [60, 0]] }", 5, 19,
       "a point of 'range' is three numbers: [key, low, high]"},
      {m + "[[control]]\nfrom = \"note\"\n" + to + "range = { low = 1 }", 5, 9,
       "'range' by key is a table: { keys = "},
      {m + "[[control]]\nfrom = \"note\"\n" + to + "follows_pitch = false", 5, 17,
       "'follows_pitch' is for plucks, bows, impulses and swings"},
      {m + "[parameters]\nK = { value = 1, range = 3 }", 3, 26,
       "'range' must be two numbers: [low, high]"},
      {m + "[parameters]\nK = { value = 1, range = [0, 1, 2] }", 3, 26,
       "'range' must be two numbers: [low, high]"},
      {m + "[parameters]\nK = { value = 1, range = [0, \"x\"] }", 3, 30,
       "'range' must be a number"},
      {m + "control = 1", 2, 11, "write each control as a table of its own: [[control]]"},
      {with_control(to + "from = \"note\"\nform = 1"), 5, 8,
       "unknown key 'form' in a control; there are from, to"},
      {with_control(to), 2, 1, "'from' must be \"note\""},
      {with_control(to + "from = \"cc120\""), 4, 8, "'from' must be \"note\""},
      {with_control(to + "from = \"cc-1\""), 4, 8, "'from' must be \"note\""},
      {with_control(to + "from = \"audio0\""), 4, 8, "'from' must be \"note\""},
      {with_control(to + "from = \"/\""), 4, 8, "an OSC name has 2 to 255 characters"},
      {with_control(to + "from = \"/my finger\""), 4, 8,
       "an OSC name has 2 to 255 characters: '/', "},
      {with_control(to + "from = \"/finger#1\""), 4, 8, "an OSC name has"},
      {with_control(to + "from = \"/f[ab]\""), 4, 8, "an OSC name has"},
      {with_control(to + "from = \"/f*\""), 4, 8, "an OSC name has"},
      {with_control(to + "from = \"/{a,b}\""), 4, 8, "an OSC name has"},
      {with_control(to + "from = \"/a,b\""), 4, 8, "an OSC name has"},
      {with_control(to + "from = \"/d\u00e9\""), 4, 8, "an OSC name has"},
      {with_control(to + "from = \"/" + std::string(255, 'a') + "\""), 4, 8, "an OSC name has"},
      {with_control(to + "from = \"/in/1/x\""), 4, 8, "'/in/1/x' is reserved by ressort"},
      {with_control(to + "from = \"/error\""), 4, 8, "'/error' is reserved by ressort"},
      {"model = \"x\"", 1, 9, "'model' must be the name of a .mdl file"},
      {"model = \"/etc/passwd\"", 1, 9, "'model' must be the name of a .mdl file"},
      {with_control("from = \"note\""), 2, 1, "a control needs 'to'"},
      {with_control(to + "from = \"note\"\nhow = \"slap\""), 5, 7,
       "'how' must be position, pluck, bow, impulse, swing, hold, touch, noise or parameter"},
      {with_control(to + "from = \"note\"\nhow = \"pluck\""), 2, 1, "a pluck needs 'travel'"},
      {with_control(to + "from = \"note\"\ncurve = \"round\""), 5, 9,
       "'curve' must be linear or exponential"},
      {with_control(to + "from = \"note\"\ncurve = \"exponential\""), 2, 1,
       "an exponential curve needs a range on one side of 0"},
      {with_control(to + "from = \"note\"\ntravel = -1"), 5, 10, "'travel' must lie between 0 and"},
      {with_control(to + "from = \"note\"\nkeys = [60, 36]"), 5, 8,
       "'keys' is the wrong way round"},
      {with_control(to + "from = \"note\"\nkeys = [60, 128]"), 5, 13,
       "'keys' must lie between 0 and 127"},
      {with_control(to + "from = \"note\"\nhow = \"noise\""), 2, 1,
       "noise needs 'length_ms' above 0"},
      {with_control(to + "from = \"note\"\nhow = \"bow\"\nlength_ms = [60, 40]"), 6, 13,
       "'length_ms' is for impulses, swings, noise, and bows with 'level_db' only"},
      {with_control(to + "from = \"note\"\nband_hz = [20, 30]"), 5, 11, "'band_hz' is for noise"},
      {with_control(to + "from = \"note\"\nnoise = 0.1"), 5, 9, "'noise' is the noise of a bow"},
      {with_control(to + "from = \"release\"\nhow = \"impulse\"\nlevel_db = [-20, 0]"), 6, 12,
       "'level_db' would change the gain of the note that is released"},
      {m + "variation = 1", 2, 13, "'variation' must be a table"},
      {m + "variation = { place = 1 }", 2, 23,
       "unknown key 'place' in the variation; there are strength, timing_ms"},
      {m + "[[lfo]]\nrate_hz = 5", 2, 1, "an LFO needs a name of its own"},
      {m + "[[lfo]]\nname = \"cc1\"", 3, 8, "an LFO needs a name of its own"},
      {m + "[[lfo]]\nname = \"v\"\nshape = \"saw\"", 4, 9, "'shape' must be sine, triangle"},
      {m + "[[lfo]]\nname = \"v\"\nby = \"note\"", 4, 6,
       "'by' must be \"level\", \"pressure\", or"},
      {m + "[[lfo]]\nname = \"v\"\n[[control]]\nfrom = \"v\"\nto = \"in1\"\nrange = [0, 1]", 4, 1,
       "an LFO moves \"pitch\" (in cents), \"level\" (in dB) or a parameter"},
      {m + "[[lfo]]\nname = \"v\"\n[[control]]\nfrom = \"v\"\nto = \"pitch\"", 4, 1,
       "the control of an LFO needs 'range'"},
  };
  for (const Complaint& complaint : complaints) {
    check_error(complaint);
  }
}

TEST_CASE("errors in names of controllers have a line and a column", "[preset]") {
  const std::string ring =
      "model = \"x.mdl\"\n[[control]]\nfrom = \"cc71\"\nto = \"K\"\nname = \"Ring\"\n";
  const auto second = [](const std::string& from, const std::string& more) {
    return "[[control]]\nfrom = \"" + from + "\"\nto = \"K\"\n" + more;
  };
  const Complaint complaints[] = {
      {ring + second("/finger", "name = \"Finger\""), 9, 8, "only a controller, such as \"cc74\""},
      {ring + second("note", "name = \"Note\""), 9, 8, "only a controller, such as \"cc74\""},
      {ring + second("cc1", "help = \"Decay\""), 9, 8, "'help' is for a control with a 'name'"},
      {ring + second("cc1", "name = \"\""), 9, 8, "a name has 1 to 40 letters"},
      {ring + second("cc1", "name = \"a/b\""), 9, 8, "a name has 1 to 40 letters"},
      {ring + second("cc71", "name = \"Decay\""), 9, 8,
       "cc71 already has the name 'Ring'; remove one of them"},
      {ring + second("cc72", "name = \"ring\""), 9, 8,
       "'ring' is already the name of cc71; choose another"},
      {"model = \"x.mdl\"\n[[lfo]]\nname = \"motor\"\nby = \"cc1\"\n" +
           second("cc2", "name = \"Motor\""),
       8, 8, "'Motor' is already the name of cc1; choose another"},
  };
  for (const Complaint& complaint : complaints) {
    check_error(complaint);
  }
}

TEST_CASE("all errors of a preset are reported in order", "[preset]") {
  const auto read = parse_preset(
      "voices = 0\n"
      "gian = 2\n"
      "tuning = \"odd\"\n"
      "[parameters]\n"
      "K = { value = 3, range = [0, 1] }\n"
      "A = 0.1\n"
      "Z = { value = 1, range = [0, 2] }\n"
      "[[control]]\n"
      "from = \"cc120\"\n"
      "how = \"slap\"\n"
      "curve = \"round\"\n"
      "[[control]]\n"
      "from = \"note\"\n"
      "to = \"in1\"\n");
  const std::vector<std::pair<int, std::string>> expected = {
      {1, "a preset needs a model"}, {1, "'voices' must lie"}, {2, "unknown key 'gian'"},
      {3, "'tuning' must be"},       {5, "the value of 'K'"},  {6, "'A' must be a table"},
      {8, "a control needs 'to'"},   {9, "'from' must be"},    {10, "'how' must be"},
      {11, "'curve' must be"},
  };
  REQUIRE(read.errors.size() == expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) {
    CHECK(read.errors[i].line == expected[i].first);
    CHECK(read.errors[i].message.starts_with(expected[i].second));
  }
  CHECK(read.preset.controls.size() == 1);  // the valid control is kept
  std::string many = "model = \"x.mdl\"\n";
  for (int i = 0; i < 1000; ++i) {
    many += "k" + std::to_string(i) + " = 1\n";
  }
  const auto all = parse_preset(many);
  REQUIRE(all.errors.size() == most_preset_errors + 1);
  CHECK(all.errors.back().message == "too many errors; stopping here");
}

TEST_CASE("deeply nested TOML is rejected before parsing", "[preset]") {
  const auto repeated = [](std::size_t times, const std::string& text) {
    std::string all;
    for (std::size_t i = 0; i < times; ++i) {
      all += text;
    }
    return all;
  };
  const std::string message = "this is nested more than 8 levels deep";
  check_error({repeated(32000, "a.") + "a = 1", 1, 18, message});
  check_error({"model = \"x\"\n[" + repeated(30000, "a.") + "a]", 2, 19, message});
  check_error({"a = " + repeated(60000, "["), 1, 13, message});
  check_error({"# [[[[[[[[[[\na = " + repeated(10000, "{a="), 2, 29, message});
  check_error(
      {"a = '''\n" + repeated(20, "[\n") + "'''\nb = " + repeated(9, "["), 23, 13, message});
  check_error({R"(a = "\"")"
               "\nb = " +
                   repeated(9, "["),
               2, 13, message});
  check_error({"a = \"\"\"x\"\"\"\"\"\nb = " + repeated(9, "["), 2, 13, message});
  // Texts, numbers and closed brackets do not count as nesting.
  for (const std::string& fine :
       {"\"" + repeated(20, "[") + "\"", "'" + repeated(20, ".") + "'",
        "\"\"\"" + repeated(20, "[\n\"\"") + "\"\"\"", "\"x\" # " + repeated(20, ".")}) {
    const auto read = parse_preset("model = \"x.mdl\"\ndescription = " + fine);
    INFO(fine << (read.ok() ? "" : ": " + read.errors[0].message));
    CHECK(read.ok());
  }
  CHECK(parse_preset("model = \"x.mdl\"\n[parameters]\na.value = 1.5\na.range = [0.5, 2.5]").ok());
  std::string numbers = "model = \"x.mdl\"\n[parameters]\n";
  for (int i = 0; i < 30; ++i) {
    numbers += "p" + std::to_string(i) + " = { value = 0.5, range = [0.25, 0.75] }\n";
  }
  CHECK(parse_preset(numbers).ok());
  // Up to the limit, the TOML parser reports errors.
  check_error({"model = \"x.mdl\"\n" + repeated(8, "a.") + "a = 1", 2, 1, "unknown key 'a'"});
}

TEST_CASE("invalid TOML is reported with its position", "[preset]") {
  for (const std::string text : {"model = ", "model = \"x", "[parameters",
                                 "model = \"x\"\nmodel = \"y\"", "= 3", "\xff\xfe", "a = [1, 2"}) {
    const auto preset = parse_preset(text);
    INFO(text);
    REQUIRE(preset.errors.size() == 1);
    CHECK(preset.errors[0].line >= 1);
    CHECK(preset.errors[0].column >= 1);
    CHECK_FALSE(preset.errors[0].message.empty());
  }
  check_error({std::string(max_preset_bytes + 1, ' '), 1, 1, "the file is longer than 64 KiB"});
  const auto second = parse_preset("model = \"x\"\nvoices = = 3");
  REQUIRE(second.errors.size() == 1);
  CHECK(second.errors[0].line == 2);
  // Random text.
  support::Random random(12);
  const std::string good =
      with_control("from = \"note\"\nto = \"in1\"\nrange = [0, 1]\nhow = \"hold\"");
  for (int i = 0; i < 3000; ++i) {
    std::string text = good;
    for (std::size_t k = 1 + random.below(4); k-- > 0;) {
      text[random.below(text.size())] = static_cast<char>(random.below(256));
    }
    for (const Error& error : parse_preset(text).errors) {
      REQUIRE_FALSE(error.message.empty());
    }
  }
}

TEST_CASE("a model that no key can play suggests a line to add", "[preset]") {
  const std::string triangle = "@g ground 0.\n@m0 mass 1. 0. 0.\n@l spring @g @m0 0.1\n";
  const auto told = [&](const std::string& text) -> std::string {
    const Network network = network_of(text);
    const auto idle = idle_keys(network, default_preset(network, false));
    return idle ? std::to_string(idle->line) + ": " + idle->message : "";
  };
  CHECK(told(triangle + "@in1 frcInput @m0\n") == "");
  CHECK(told(triangle + "@in1 posInput 0.\n@p nlPluck @in1 @m0 0.1 0.1\n") == "");
  CHECK(
      told(triangle) ==
      "1: no key plays this model: it has no input; '@in1 frcInput @m0' would let keys strike it");
  CHECK(told(triangle + "@in1 posInput 0.\n@p spring @in1 @m0 0.1\n") ==
        "4: no key plays this model: '@in1' moves no pluck, no bow and no contact; '@in2 frcInput "
        "@m0' would "
        "let keys strike it");
  CHECK(told(triangle + "@in1 frcInput @g\n@k audioParam @in2\n@o osc 1 k 0 0 0\n") ==
        "4: no key plays this model: '@in1' pushes a mass that never moves; '@in3 frcInput @m0' "
        "would let "
        "keys strike it");
  CHECK(told("@s mesh 4 4 1. 0.1 0. 0. 0.\n").find("'@in1 frcInput [@s 0.3 0.4]'") !=
        std::string::npos);
  CHECK(told("@g ground 0.\n@in1 frcInput @g\n") == "");  // no mass moves
  // The suggestion skips grounds.
  const Preset second =
      default_preset(network_of(triangle + "@in1 frcInput @g\n@in2 frcInput @m0\n"), false);
  REQUIRE(second.controls.size() == 2);
  CHECK(second.controls[1].source == ControlSource::note);
  CHECK(second.controls[1].target == "in2");
}

TEST_CASE("all mismatches between preset and model are reported", "[preset]") {
  const auto preset = parse_preset(
      "model = \"x.mdl\"\n[[control]]\nfrom = \"cc1\"\nto = \"Q\"\n[[control]]\n"
      "from = \"note\"\nto = \"in2\"\n[parameters]\nP = { value = 1, range = [0, 1] }\n");
  REQUIRE(preset.ok());
  const auto found = find_preset_errors(network_of(scenes::poly_triangle()), preset.preset);
  REQUIRE(found.size() == 3);
  CHECK(found[0].line == 2);
  CHECK(found[0].message == "the model has no parameter 'Q'; it has m_K, m_Z");
  CHECK(found[1].line == 5);
  CHECK(found[1].message == "the model has no input 'in2'; it has 1");
  CHECK(found[2].line == 9);
  CHECK(found[2].message == "the model has no parameter 'P'; it has m_K, m_Z");
}

TEST_CASE("the hardness of blows is a parameter, and needs blows with a length", "[preset]") {
  const auto errors = [](const std::string& hardness, const std::string& control) {
    const auto preset =
        parse_preset("model = \"x.mdl\"\nhardness = \"" + hardness +
                     "\"\n[parameters]\ntouch = { value = 0, range = [-1, 1] }\n[[control]]\n"
                     "from = \"note\"\nto = \"in1\"\nhow = \"impulse\"\n" +
                     control);
    REQUIRE(preset.ok());
    return find_preset_errors(
        with_preset_parameters(network_of(scenes::poly_triangle()), preset.preset), preset.preset);
  };
  CHECK(errors("touch", "length_ms = [4, 1]").empty());
  REQUIRE(errors("touch", "").size() == 1);
  CHECK(errors("touch", "")[0].message.starts_with("'hardness' must name one of [parameters]"));
  CHECK(errors("touch", "")[0].line == 2);
  CHECK(errors("hard", "length_ms = [4, 1]").size() == 2);  // and 'touch' is no parameter
}

TEST_CASE("the default preset chooses gestures by the laws of the links", "[preset]") {
  const Preset struck = default_preset(network_of(scenes::poly_triangle()), false);
  CHECK(struck.keyboard);
  CHECK(struck.gain == 1.0);
  REQUIRE(struck.controls.size() == 1);
  CHECK(struck.controls[0].gesture == Gesture::impulse);
  CHECK(struck.controls[0].target == "in1");

  const Preset plucked = default_preset(network_of(scenes::iplay_the_triangle()), false);
  REQUIRE(plucked.controls.size() == 2);  // keys, and the modulation wheel
  CHECK(plucked.controls[0].source == ControlSource::note);
  CHECK(plucked.controls[0].gesture == Gesture::pluck);
  CHECK(plucked.controls[0].travel == Approx(0.05).epsilon(1e-12));  // beyond the pluck's 0.01
  CHECK(plucked.controls[1].source == ControlSource::controller);
  CHECK(plucked.controls[1].number == 1);

  CHECK(default_preset(network_of("@p param 0\n" + scenes::bowed_string("p")), false)
            .controls[0]
            .gesture == Gesture::bow);
  const Preset bowed = default_preset(network_of(scenes::bowed_string()), false);
  REQUIRE(bowed.controls.size() == 1);
  CHECK(bowed.controls[0].gesture == Gesture::bow);
  // A bow sounds only between a third of its scale and the scale.
  CHECK(bowed.controls[0].low > 5e-5 / 3);
  CHECK(bowed.controls[0].high < 5e-5);

  const Preset heard = default_preset(network_of(scenes::resonator()), false);
  REQUIRE(heard.controls.size() == 1);
  CHECK(heard.controls[0].source == ControlSource::audio);

  // Every default preset compiles, and the bare one maps channel n to input n.
  for (const scenes::Example& example : scenes::nine_instruments()) {
    CAPTURE(example.name);
    const Network network = network_of(example.text);
    CHECK(compile_network(network, default_preset(network, false), {}));
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

}  // namespace ressort::preset_test
