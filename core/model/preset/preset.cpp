#include "core/model/preset/preset.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <set>

#include "core/model/language/expression.h"
#include "core/model/language/tokens.h"
#include "core/model/preset/toml_table.h"

namespace ressort::model {
namespace {

using IsReserved = bool (*)(std::string_view address);

// Returns "position, pluck, bow, impulse, hold or parameter".
std::string words_for_how() {
  std::string words;
  for (const GestureRow& row : gestures) {
    if (!row.does.empty()) {
      const std::string_view between = &row == std::end(gestures) - 1 ? " or " : ", ";
      words.append(words.empty() ? "" : between).append(row.name);
    }
  }
  return words;
}

// Texts and limits for the points of a curve.
struct CurveWords {
  const char* name;
  const char* example;
  const char* point;  // meaning of its two numbers
  double least[2];
  double most[2];
  const char* bounds;
};

// Reads "velocity = [[0, 10], [127, 127]]", or points of three numbers. The first numbers must
// ascend; `least` and `most` hold for the first number and for all others.
template <std::size_t count>
void read_points(const toml::array& rows, TomlTable& reader, const CurveWords& words,
                 std::vector<std::array<double, count>>& points) {
  constexpr std::size_t most_points = 16;
  const std::string name = std::string("'") + words.name + "'";
  if (rows.size() < 2 || rows.size() > most_points) {
    reader.fail(rows, name + " has 2 to 16 points: " + words.example);
    return;
  }
  for (const toml::node& row : rows) {
    const toml::array* const point = row.as_array();
    const auto is_number = [](const toml::node& node) { return node.is_number(); };
    if (point == nullptr || point->size() != count ||
        !std::all_of(point->begin(), point->end(), is_number)) {
      reader.fail(row, "a point of " + name + " is " + (count == 2 ? "two" : "three") +
                           " numbers: " + words.point);
      return;
    }
    std::array<double, count> read{};
    for (std::size_t i = 0; i < count; ++i) {
      read[i] = *(*point)[i].template value<double>();
      const std::size_t which = i == 0 ? 0 : 1;
      if (!(read[i] >= words.least[which] && read[i] <= words.most[which])) {
        reader.fail(row, words.bounds);
        return;
      }
    }
    if (!points.empty() && !(read[0] > points.back()[0])) {
      reader.fail(row, "the points of " + name + " must ascend");
      return;
    }
    points.push_back(read);
  }
}

// Reads the curves of a parameter whose range is known.
void read_curves(const toml::table& row, TomlTable& reader, const Preset& preset,
                 ParameterSetting& setting) {
  const std::string range = print_number(setting.minimum) + " to " + print_number(setting.maximum);
  const std::string in_range = "a key lies between 0 and 127, and its value in the range of " +
                               quoted(setting.name) + ", " + range;
  const bool is_by_ratios = setting.minimum > 0.0;
  const CurveWords keys{.name = "keys",
                        .example = "[[21, 0.1], [108, 0.4]]",
                        .point = "[key, value]",
                        .least = {0.0, setting.minimum},
                        .most = {127.0, setting.maximum},
                        .bounds = in_range.c_str()};
  const CurveWords velocity{
      .name = "velocity",
      .example = is_by_ratios ? "[[0, 0.8], [127, 1.2]]" : "[[0, -0.1], [127, 0.1]]",
      .point = is_by_ratios ? "[velocity, factor]" : "[velocity, offset]",
      .least = {0.0, is_by_ratios ? 1e-6 : -1e12},
      .most = {127.0, is_by_ratios ? 1e6 : 1e12},
      .bounds = is_by_ratios ? "a velocity lies between 0 and 127, its factor between 1e-6 and 1e6"
                             : "a velocity lies between 0 and 127"};
  for (const auto& [words, points] :
       {std::pair(&keys, &setting.keys), std::pair(&velocity, &setting.velocity)}) {
    const toml::node* const node = row.get(words->name);
    if (node == nullptr) {
      continue;
    }
    if (!node->is_array()) {
      reader.fail(*node, quoted(words->name) + " must be points: " + words->example);
    } else if (!preset.keyboard) {
      reader.fail(*node, quoted(words->name) +
                             " has no effect with tuning = \"fixed\", where all keys play the same "
                             "note; remove one of them");
    } else {
      read_points(*node->as_array(), reader, *words, *points);
    }
  }
  double keys_at = 0.0;
  if (reader.number("keys_at", keys_at, setting.minimum, setting.maximum)) {
    setting.keys_at = keys_at;
    if (row.get("keys") == nullptr) {
      reader.fail(*row.get("keys_at"), "'keys_at' needs 'keys'");
    }
  }
}

void read_parameter(std::string name, const toml::node& node, Preset& preset,
                    std::vector<Error>& errors) {
  ParameterSetting setting{.name = std::move(name), .location = location_of(node)};
  const std::string shown = quoted(setting.name);
  const toml::table* row = node.as_table();
  if (row == nullptr) {
    errors.push_back({shown + " must be a table: { value = 0.1, range = [0.001, 0.3] }",
                      setting.location.line, setting.location.column});
    return;
  }
  TomlTable reader(*row, "the parameter " + shown, errors);
  reader.allow("parameters");
  if (row->get("value") == nullptr || row->get("range") == nullptr) {
    reader.fail(node, shown + " needs a value and a range");
    return;
  }
  const bool has_value = reader.number("value", setting.value, -1e12, 1e12);
  const bool has_range = reader.range("range", setting.minimum, setting.maximum);
  if (has_value && has_range &&
      !(setting.minimum <= setting.value && setting.value <= setting.maximum)) {
    reader.fail(node, "the value of " + shown + " lies outside its range");
  }
  if (has_range) {
    read_curves(*row, reader, preset, setting);
  }
  preset.parameters.push_back(std::move(setting));
}

// Returns true for a valid OSC address.
bool is_address(std::string_view text) {
  constexpr std::size_t longest = 255;
  return text.size() > 1 && text.size() <= longest && text[0] == '/' &&
         std::ranges::all_of(text, [](char c) {
           constexpr std::string_view meant_otherwise = "#*,?[]{}";
           return c > ' ' && c <= '~' && meant_otherwise.find(c) == std::string_view::npos;
         });
}

// Reads "note", "pressure", "cc1", "audio2" or "/name".
bool read_source(std::string_view text, ControlSetting& control) {
  const auto numbered = [&](std::string_view prefix, int least, int most) {
    if (!text.starts_with(prefix)) {
      return false;
    }
    const std::string_view digits = text.substr(prefix.size());
    int number = -1;
    const auto [end, failure] =
        std::from_chars(digits.data(), digits.data() + digits.size(), number);
    control.number = number;
    return failure == std::errc{} && end == digits.data() + digits.size() && number >= least &&
           number <= most;
  };
  if (text == "note") {
    control.source = ControlSource::note;
  } else if (text == "release") {
    control.source = ControlSource::release;
  } else if (text == "pressure") {
    control.source = ControlSource::pressure;
  } else if (numbered("cc", 0, 119)) {
    control.source = ControlSource::controller;
  } else if (numbered("audio", 1, 64)) {
    control.source = ControlSource::audio;
  } else if (text.starts_with('/')) {
    control.source = ControlSource::osc;
    control.address = std::string(text);
  } else {
    return false;
  }
  return true;
}

// Reads the name of an LFO.
bool read_lfo_source(std::string_view text, const Preset& preset, ControlSetting& control) {
  for (std::size_t i = 0; i < preset.lfos.size(); ++i) {
    if (preset.lfos[i].name == text) {
      control.source = ControlSource::lfo;
      control.number = static_cast<int>(i);
      control.address = preset.lfos[i].name;
      return true;
    }
  }
  return false;
}

void read_lfo(const toml::table& table, Preset& preset, std::vector<Error>& errors) {
  TomlTable reader(table, "an LFO", errors);
  reader.allow("lfo");
  LfoSetting setting;
  Lfo& lfo = setting.lfo;
  ControlSetting source;
  if ((reader.text("name", setting.name) || table.get("name") == nullptr) &&
      (!is_identifier(setting.name) || read_source(setting.name, source) ||
       read_lfo_source(setting.name, preset, source))) {
    const toml::node* const node = table.get("name");
    reader.fail(node != nullptr ? *node : table,
                "an LFO needs a name of its own, of letters and digits: name = \"vibrato\"");
  }
  reader.number("rate_hz", lfo.rate_hz, 0.01, 50.0);
  if (reader.number("beats", lfo.beats, 0.01, 100.0) && table.get("rate_hz") != nullptr) {
    reader.fail(*table.get("beats"), "'beats' and 'rate_hz' both set the rate; remove one of them");
  }
  reader.number("delay_s", lfo.delay_s, 0.0, 60.0);
  reader.number("fade_s", lfo.fade_s, 0.0, 60.0);
  reader.number("depth", lfo.depth, 0.0, 1.0);
  reader.number("deviation", lfo.deviation, 0.0, 1.0);
  if (std::string shape; reader.text("shape", shape)) {
    lfo.shape = shape == "triangle" ? LfoShape::triangle
                : shape == "random" ? LfoShape::random
                : shape == "steps"  ? LfoShape::steps
                : shape == "fall"   ? LfoShape::fall
                                    : LfoShape::sine;
    if (lfo.shape == LfoShape::sine && shape != "sine") {
      reader.fail(*table.get("shape"), "'shape' must be sine, triangle, random, steps or fall");
    }
  }
  if (std::string by; reader.text("by", by)) {
    ControlSetting scaled;
    if (by == "level") {
      setting.by = ControlSource::note;
    } else if (read_source(by, scaled) && (scaled.source == ControlSource::controller ||
                                           scaled.source == ControlSource::pressure)) {
      setting.by = scaled.source;
      setting.number = scaled.number;
    } else {
      reader.fail(*table.get("by"),
                  "'by' must be \"level\", \"pressure\", or \"cc0\" to \"cc119\"");
    }
  }
  preset.lfos.push_back(std::move(setting));
}

// Checks the control of an LFO, which has no gesture.
void check_lfo_control(const toml::table& table, const ControlSetting& control, TomlTable& reader) {
  if (control.gesture != Gesture::parameter) {
    reader.fail(
        table,
        "an LFO moves \"pitch\" (in cents), \"level\" (in dB) or a parameter; set 'to' to one "
        "of them");
  }
  if (table.get("range") == nullptr) {
    reader.fail(
        table,
        "the control of an LFO needs 'range': cents, dB, or factors of a parameter, range = "
        "[-10, 10]");
  }
  for (const auto& [key, node] : table) {
    if (key.str() != "from" && key.str() != "to" && key.str() != "range") {
      reader.fail(node, quoted(key.str()) +
                            " has no effect on an LFO; it has 'from', 'to' and "
                            "'range'");
    }
  }
}

// Returns the gesture of a control without `how`: it moves an input or sets a parameter.
Gesture usual_gesture(std::string_view target) {
  return target.starts_with("in") && target.size() > 2 &&
                 std::isdigit(static_cast<unsigned char>(target[2])) != 0
             ? Gesture::position
             : Gesture::parameter;
}

// Reads the name and the help of a controller. All controls of one controller are one knob, which
// has one name.
void read_name(const toml::table& table, TomlTable& reader, const Preset& preset,
               ControlSetting& control) {
  constexpr std::size_t longest = 40;
  const bool has_help = reader.text("help", control.help);
  if (!reader.text("name", control.name)) {
    if (has_help) {
      reader.fail(*table.get("help"), "'help' is for a control with a 'name'");
    }
    return;
  }
  const toml::node& node = *table.get("name");
  const auto is_plain = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == ' ' || c == '-';
  };
  if (control.name.empty() || control.name.size() > longest || control.name.front() == ' ' ||
      control.name.back() == ' ' || !std::ranges::all_of(control.name, is_plain)) {
    reader.fail(node, "a name has 1 to 40 letters, digits, blanks and hyphens");
  } else if (control.source != ControlSource::controller) {
    reader.fail(node, "only a controller, such as \"cc74\", has a name");
  }
  for (const LfoSetting& lfo : preset.lfos) {
    if (lfo.by == ControlSource::controller && lfo.number != control.number &&
        word_of(lfo.name) == word_of(control.name)) {
      reader.fail(node, quoted(control.name) + " is already the name of cc" +
                            std::to_string(lfo.number) + "; choose another");
      return;
    }
  }
  for (const ControlSetting& other : preset.controls) {
    if (other.name.empty()) {
      continue;
    }
    const bool is_same = other.number == control.number;
    if (is_same && other.name != control.name) {
      reader.fail(node, "cc" + std::to_string(control.number) + " already has the name " +
                            quoted(other.name) + "; remove one of them");
      return;
    }
    if (!is_same && word_of(other.name) == word_of(control.name)) {
      reader.fail(node, quoted(control.name) + " is already the name of cc" +
                            std::to_string(other.number) + "; choose another");
      return;
    }
  }
}

// Reads "round_robin = [1, 2]".
void read_round_robin(TomlTable& reader, ControlSetting& control) {
  constexpr double most_turns = 16.0;
  double turn = control.turn;
  double turns = control.turns;
  if (!reader.range("round_robin", turn, turns, 1.0, most_turns)) {
    return;
  }
  if (turn != std::floor(turn) || turns != std::floor(turns)) {
    reader.fail(*reader.get("round_robin"), "'round_robin' must be two whole numbers: [1, 2]");
  } else if (control.source != ControlSource::note) {
    reader.fail(*reader.get("round_robin"), "'round_robin' is for notes only");
  }
  control.turn = static_cast<int>(turn);
  control.turns = static_cast<int>(turns);
}

// Returns the pair on a key, joined by straight lines.
KeyPair pair_on(const std::vector<KeyPair>& points, double key) {
  std::vector<CurvePoint> low;
  std::vector<CurvePoint> high;
  for (const KeyPair& point : points) {
    low.push_back({point[0], point[1]});
    high.push_back({point[0], point[2]});
  }
  return {key, value_at(low, key), value_at(high, key)};
}

// A number or a pair of numbers of a control that may differ from key to key.
struct NumbersByKey {
  const char* name;
  const char* example;
  const char* point;
  double least;
  double most;
  const char* bounds;
};

// Reads the points of { keys = [[21, 5, 4], [108, 1, 0.6]] } if `name` is a table. Returns true if
// they are valid; `low` and `high` are then those of middle C.
template <std::size_t count>
bool read_by_key(TomlTable& reader, const ControlSetting& control, const NumbersByKey& numbers,
                 std::vector<KeyPair>& points, double& low, double& high) {
  const toml::node* const node = reader.get(numbers.name);
  const toml::table* const table = node == nullptr ? nullptr : node->as_table();
  if (table == nullptr) {
    return false;
  }
  const toml::array* const rows = table->get_as<toml::array>("keys");
  if (rows == nullptr || table->size() != 1) {
    return reader.fail(
        *node, quoted(numbers.name) + " by key is a table: { keys = " + numbers.example + " }");
  }
  if (control.source != ControlSource::note || control.gesture == Gesture::parameter) {
    return reader.fail(*node, quoted(numbers.name) +
                                  " can differ from key to key only for notes that play an input; "
                                  "a parameter has 'keys' in [parameters]");
  }
  std::vector<std::array<double, count>> read;
  read_points(*rows, reader,
              {.name = numbers.name,
               .example = numbers.example,
               .point = numbers.point,
               .least = {0.0, numbers.least},
               .most = {127.0, numbers.most},
               .bounds = numbers.bounds},
              read);
  if (read.size() != rows->size()) {
    return false;  // reported
  }
  for (const std::array<double, count>& point : read) {
    points.push_back({point[0], point[1], point[count - 1]});
  }
  const KeyPair middle = pair_on(points, middle_c);
  low = middle[1];
  high = middle[2];
  return true;
}

void read_control(const toml::table& table, Preset& preset, std::vector<Error>& errors,
                  IsReserved is_reserved) {
  const std::size_t before = errors.size();
  TomlTable reader(table, "a control", errors);
  reader.allow("control");
  ControlSetting control{.location = location_of(table)};
  std::string from;
  if ((reader.text("from", from) || table.get("from") == nullptr) && !read_source(from, control) &&
      !read_lfo_source(from, preset, control)) {
    const toml::node* node = table.get("from");
    reader.fail(
        node != nullptr ? *node : table,
        "'from' must be \"note\", \"release\", \"pressure\", \"cc0\" to \"cc119\", \"audio1\", "
        "an OSC name such as \"/finger\", or the name of an [[lfo]]");
  }
  if (control.source == ControlSource::osc && !is_address(control.address)) {
    reader.fail(*table.get("from"),
                "an OSC name has 2 to 255 characters: '/', then letters, digits and signs except "
                "blanks and # * , ? [ ] { }");
  } else if (control.source == ControlSource::osc && is_reserved != nullptr &&
             is_reserved(control.address)) {
    reader.fail(*table.get("from"), quoted(control.address) +
                                        " is reserved by ressort; choose another name, such "
                                        "as \"/finger\"");
  }
  if ((reader.text("to", control.target) || table.get("to") == nullptr) && control.target.empty()) {
    reader.fail(table, "a control needs 'to': an input such as \"in1\" or a parameter");
  }
  read_name(table, reader, preset, control);
  control.gesture = usual_gesture(control.target);
  if (std::string how; reader.text("how", how)) {
    const auto* row = std::ranges::find_if(gestures, [&](const GestureRow& gesture) {
      return gesture.name == how && !gesture.does.empty();
    });
    if (row != std::end(gestures)) {
      control.gesture = row->gesture;
    } else {
      reader.fail(*table.get("how"), "'how' must be " + words_for_how());
    }
  }
  const auto pair_or_keys = [&](const NumbersByKey& numbers, std::vector<KeyPair>& points,
                                double& low, double& high) {
    const toml::node* const node = reader.get(numbers.name);
    return node != nullptr && node->is_table()
               ? read_by_key<3>(reader, control, numbers, points, low, high)
               : reader.pair(numbers.name, low, high, numbers.least, numbers.most);
  };
  const bool has_range = pair_or_keys({"range", "[[21, 0.1, 1], [108, 0.2, 2]]", "[key, low, high]",
                                       -1e12, 1e12, "a key lies between 0 and 127"},
                                      control.range_keys, control.low, control.high);
  const toml::node* const travel = reader.get("travel");
  double same_travel = 0.0;
  const bool has_travel =
      travel != nullptr && travel->is_table()
          ? read_by_key<2>(reader, control,
                           {"travel", "[[21, 0.1], [108, 0.02]]", "[key, travel]", 0.0, 1e12,
                            "a key lies between 0 and 127, and its travel is not negative"},
                           control.travel_keys, control.travel, same_travel)
          : reader.number("travel", control.travel, 0.0, 1e12);
  control.has_level =
      pair_or_keys({"level_db", "[[21, -30, 0], [108, -30, 3]]", "[key, low, high]", -120.0, 40.0,
                    "a key lies between 0 and 127, its dB between -120 and 40"},
                   control.level_keys, control.low_db, control.high_db);
  if (control.has_level && control.gesture == Gesture::parameter) {
    reader.fail(*table.get("level_db"), "'level_db' is for controls of inputs, not of parameters");
  }
  if (control.has_level && control.source == ControlSource::release) {
    reader.fail(*table.get("level_db"),
                "'level_db' would change the gain of the note that is released; set 'range'");
  }
  const bool is_noise = control.gesture == Gesture::noise;
  const double longest_ms = is_noise ? 1e4 : 1e3;
  if (pair_or_keys({"length_ms", "[[21, 5, 4], [108, 1.1, 0.6]]", "[key, longest, shortest]", 0.0,
                    longest_ms,
                    is_noise ? "a key lies between 0 and 127, its lengths between 0 and 10000 ms"
                             : "a key lies between 0 and 127, its lengths between 0 and 1000 ms"},
                   control.length_keys, control.longest_ms, control.shortest_ms) &&
      control.gesture != Gesture::impulse && control.gesture != Gesture::swing && !is_noise &&
      !(control.gesture == Gesture::bow && control.has_level)) {
    reader.fail(*table.get("length_ms"),
                "'length_ms' is for impulses, swings, noise, and bows with 'level_db' only");
  }
  const bool has_lengths = control.longest_ms > 0.0 && control.shortest_ms > 0.0 &&
                           std::ranges::all_of(control.length_keys, [](const KeyPair& point) {
                             return point[1] > 0.0 && point[2] > 0.0;
                           });
  if (is_noise && !has_lengths) {
    reader.fail(table,
                "noise needs 'length_ms' above 0: the T60 of the softest and the hardest "
                "burst, length_ms = [60, 40]");
  }
  if (reader.number("noise", control.noise, 0.0, 1.0) && control.gesture != Gesture::bow) {
    reader.fail(*table.get("noise"),
                "'noise' is the noise of a bow; use how = \"noise\" for a "
                "burst of noise");
  }
  if (reader.range("band_hz", control.low_hz, control.high_hz, 1.0, 1e5) && !is_noise &&
      control.noise == 0.0) {
    reader.fail(*table.get("band_hz"), "'band_hz' is for noise, and for a bow with 'noise', only");
  }
  constexpr Gesture scaled[] = {Gesture::pluck, Gesture::bow, Gesture::impulse, Gesture::swing};
  if (reader.flag("follows_pitch", control.follows_pitch) &&
      std::ranges::find(scaled, control.gesture) == std::end(scaled)) {
    reader.fail(*table.get("follows_pitch"),
                "'follows_pitch' is for plucks, bows, impulses and swings");
  }
  double lowest = 0.0;
  double highest = 127.0;
  if (reader.range("keys", lowest, highest, 0.0, 127.0)) {
    control.lowest_key = static_cast<int>(lowest);
    control.highest_key = static_cast<int>(highest);
  }
  read_round_robin(reader, control);
  if (std::string unit; reader.text("unit", unit)) {
    control.in_swings = unit == "swing";
    if (unit != "swing" && unit != "position") {
      reader.fail(*table.get("unit"), "'unit' must be position or swing");
    } else if (control.in_swings && control.gesture != Gesture::touch) {
      reader.fail(*table.get("unit"), "only a touch is measured in swings");
    } else if (control.in_swings && !control.range_keys.empty()) {
      reader.fail(*table.get("unit"), "a range in swings is the same on all keys");
    }
  }
  std::string curve = "linear";
  if (reader.text("curve", curve) && curve != "exponential" && curve != "linear") {
    reader.fail(*table.get("curve"), "'curve' must be linear or exponential");
  }
  control.exponential = curve == "exponential";
  const bool is_one_sided = control.low * control.high > 0.0 &&
                            std::ranges::all_of(control.range_keys, [&](const KeyPair& point) {
                              return point[1] * point[2] > 0.0;
                            });
  if (control.exponential && (has_range || table.get("range") == nullptr) && !is_one_sided) {
    reader.fail(table, "an exponential curve needs a range on one side of 0");
  }
  if (control.source == ControlSource::lfo) {
    check_lfo_control(table, control, reader);
  }
  const GestureRow& gesture = row_of(control.gesture);
  if (!gesture.needs_travel.empty() && (has_travel || table.get("travel") == nullptr) &&
      !(control.travel > 0.0 && std::ranges::all_of(control.travel_keys, [](const KeyPair& point) {
          return point[1] > 0.0;
        }))) {
    reader.fail(table, "a " + std::string(gesture.name) +
                           " needs 'travel': " + std::string(gesture.needs_travel));
  }
  if (errors.size() == before) {
    preset.controls.push_back(std::move(control));
  }
}

// Reads "channels = [1, 2]".
void read_channels(const toml::node& node, TomlTable& reader, Preset& preset) {
  const toml::array* const channels = node.as_array();
  if (channels == nullptr || channels->empty()) {
    reader.fail(node, "'channels' must be MIDI channels from 1 to 16: [1, 2]");
    return;
  }
  preset.channels = 0;
  for (const toml::node& channel : *channels) {
    const auto number = channel.value<std::int64_t>();
    if (!channel.is_integer() || *number < 1 || *number > 16) {
      reader.fail(channel, "a MIDI channel is a whole number from 1 to 16");
      return;
    }
    preset.channels |= 1U << (*number - 1);
  }
}

void read_velocity_points(const toml::array& rows, TomlTable& reader, Preset& preset) {
  constexpr double highest = 127.0;
  std::vector<CurvePoint> points;
  read_points(rows, reader,
              {.name = "velocity",
               .example = "[[0, 0], [127, 127]]",
               .point = "[velocity, new velocity]",
               .least = {0.0, 0.0},
               .most = {highest, highest},
               .bounds = "a velocity lies between 0 and 127"},
              points);
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (i > 0 && points[i][1] < points[i - 1][1]) {
      reader.fail(rows[i], "the points of 'velocity' must ascend");
      return;
    }
    preset.velocity_points.push_back({points[i][0] / highest, points[i][1] / highest});
  }
}

// Reads a number, or points of keys and numbers.
void read_by_key(const toml::table& root, TomlTable& reader, const CurveWords& words,
                 std::vector<CurvePoint>& points) {
  if (const toml::node* node = root.get(words.name); node != nullptr && node->is_array()) {
    read_points(*node->as_array(), reader, words, points);
  } else if (double value = 0.0; reader.number(words.name, value, words.least[1], words.most[1])) {
    points = {{0.0, value}};
  }
}

// Reads the keys for tuning and playing.
void read_keys(const toml::table& root, TomlTable& reader, Preset& preset) {
  reader.number("a4_hz", preset.a4_hz, 220.0, 880.0);
  reader.number("glide_s", preset.glide_s, 0.0, 60.0);
  const auto file = [&](const char* key, std::string_view ending, std::string& name,
                        SourceLocation& location) {
    if (!reader.text(key, name)) {
      return;
    }
    location = location_of(*root.get(key));
    constexpr std::size_t longest_name = 255;
    if (name.size() > longest_name || name.find('/') != name.npos ||
        !(name.ends_with(ending) || (ending == ".scl" && name.ends_with(".ascl")))) {
      reader.fail(location, "'" + std::string(key) + "' must be the name of a " +
                                std::string(ending) + " file beside the preset");
      name.clear();
    }
  };
  file("scale", ".scl", preset.scale, preset.scale_location);
  file("keyboard_map", ".kbm", preset.keyboard_map, preset.keyboard_map_location);
  if (const toml::node* node = root.get("channels")) {
    read_channels(*node, reader, preset);
  }
  if (const toml::node* node = root.get("velocity"); node != nullptr && node->is_array()) {
    read_velocity_points(*node->as_array(), reader, preset);
  } else {
    reader.number("velocity", preset.velocity, -1.0, 1.0);
  }
  if (std::string play; reader.text("play", play)) {
    preset.legato = play == "legato";
    preset.mono = preset.legato || play == "mono";
    if (!preset.mono && play != "poly") {
      reader.fail(*root.get("play"), "'play' must be poly, mono or legato");
    }
  }
}

MorphSetting read_values(const toml::table& table, std::vector<Error>& errors) {
  MorphSetting stop{.location = location_of(table)};
  TomlTable reader(table, "a stop of the morph", errors);
  for (const auto& [key, node] : table) {
    const std::string name(key.str());
    ParameterSetting setting{.name = name, .location = location_of(node)};
    if (name == "gain") {
      reader.number(name, stop.gain, 1e-9, 1e9);
    } else if (reader.number(name, setting.value, -1e12, 1e12)) {
      setting.minimum = setting.maximum = setting.value;
      stop.values.push_back(std::move(setting));
    }
  }
  return stop;
}

void read_morph(const toml::node& node, Preset& preset, std::vector<Error>& errors) {
  const toml::table* const table = node.as_table();
  if (table == nullptr) {
    const SourceLocation place = location_of(node);
    errors.push_back({"'morph' must be a table: [morph]", place.line, place.column});
    return;
  }
  TomlTable reader(*table, "a morph", errors);
  reader.allow("morph");
  if (!reader.text("parameter", preset.morph_parameter) || !is_identifier(preset.morph_parameter)) {
    reader.fail(node, "a morph needs the name of its parameter: parameter = \"morph\"");
  }
  const toml::node* const through = table->get("through");
  const toml::array* const stops = through != nullptr ? through->as_array() : nullptr;
  if (stops == nullptr || stops->size() < 2 || stops->size() > most_morph_stops) {
    reader.fail(through != nullptr ? *through : node,
                "a morph needs 2 to 16 stops: through = [\"Soft\", "
                "{ m_K = 0.1 }]");
    return;
  }
  for (const toml::node& stop : *stops) {
    if (const toml::table* const values = stop.as_table()) {
      preset.morph.push_back(read_values(*values, errors));
    } else if (const auto name = stop.value<std::string>(); name && !name->empty()) {
      preset.morph.push_back({.preset = *name, .location = location_of(stop)});
    } else {
      reader.fail(stop, "a stop of a morph is the name of a preset or a table of values");
    }
  }
  for (const MorphSetting& stop : preset.morph) {
    for (const ParameterSetting& value : stop.values) {
      for (const ParameterSetting& knob : preset.parameters) {
        if (knob.name == value.name) {
          reader.fail(value.location, quoted(value.name) +
                                          " is also in [parameters], so the morph cannot change "
                                          "it; remove one of the two");
        }
      }
    }
  }
}

// Reads up to `most` texts for which `is_right` returns true: ["a", "b"].
void read_texts(std::string_view key, const toml::node& node, TomlTable& reader,
                std::vector<std::string>& target, std::size_t most, const std::string& what,
                bool (*is_right)(std::string_view)) {
  const toml::array* const texts = node.as_array();
  bool is_alright = texts != nullptr && texts->size() <= most;
  for (std::size_t i = 0; is_alright && i < texts->size(); ++i) {
    target.push_back((*texts)[i].value_or(std::string()));
    is_alright = is_right(target.back());
  }
  if (!is_alright) {
    reader.fail(node, "'" + std::string(key) + "' must be " + what);
    target.clear();
  }
}

bool is_model_name(std::string_view name) {
  constexpr std::size_t longest_path = 4096;
  return name.size() <= longest_path && name.ends_with(".mdl");
}
bool is_label(std::string_view label) {
  return !label.empty() && label.front() != '@';
}

void read_root(const toml::table& root, Preset& preset, std::vector<Error>& errors,
               IsReserved is_reserved) {
  TomlTable reader(root, "a preset", errors);
  reader.allow("");
  const toml::node* const model = root.get("model");
  if (model != nullptr) {
    preset.model_location = location_of(*model);
  }
  if ((reader.text("model", preset.model) || model == nullptr) && preset.model.empty()) {
    reader.fail(preset.model_location, "a preset needs a model: model = \"PolyTriangle.mdl\"");
  }
  constexpr std::size_t longest_path = 4096;
  if (preset.model.size() > longest_path) {
    reader.fail(preset.model_location, "'model' is longer than a path may be");
    preset.model.clear();
  } else if (!preset.model.empty() && !preset.model.ends_with(".mdl")) {
    reader.fail(preset.model_location, "'model' must be the name of a .mdl file");
    preset.model.clear();
  }
  if (const toml::node* const fixed = root.get("fixed")) {
    read_texts("fixed", *fixed, reader, preset.fixed, 1024,
               "labels of the model without '@': [\"box\"]", is_label);
  }
  if (const toml::node* const with = root.get("with")) {
    read_texts("with", *with, reader, preset.with, 16,
               "up to 16 names of .mdl files: [\"Box.mdl\"]", is_model_name);
  }
  if (const toml::node* const through = root.get("through")) {
    preset.through_location = location_of(*through);
    read_texts("through", *through, reader, preset.through, most_bodies,
               "up to 8 names of .mdl files: [\"Soundboard.mdl\"]", is_model_name);
  }
  reader.text("description", preset.description);
  reader.integer("voices", preset.voices, 1, max_voices);
  reader.number("gain", preset.gain, 0.0, 1e9);
  read_by_key(root, reader,
              {.name = "damper_s",
               .example = "[[21, 0.4], [88, 0.2], [89, 0]]",
               .point = "[key, seconds]",
               .least = {0.0, 0.0},
               .most = {127.0, 60.0},
               .bounds = "a key lies between 0 and 127, its seconds between 0 and 60"},
              preset.damper_keys);
  if (!preset.damper_keys.empty()) {
    preset.damper_s = value_at(preset.damper_keys, middle_c);
    if (preset.damper_keys.size() == 1) {
      preset.damper_keys.clear();  // one number for all keys
    }
  }
  reader.flag("noise", preset.noise);
  reader.integer("transpose", preset.transpose, -most_transpose, most_transpose);
  if (reader.text("tuned_along", preset.tuned_along)) {
    preset.tuned_along_location = location_of(*root.get("tuned_along"));
  }
  if (reader.text("hardness", preset.hardness)) {
    preset.hardness_location = location_of(*root.get("hardness"));
  }
  read_by_key(root, reader,
              {.name = "keys_db",
               .example = "[[36, 7], [60, 0]]",
               .point = "[key, dB]",
               .least = {0.0, -40.0},
               .most = {127.0, 40.0},
               .bounds = "a key lies between 0 and 127, its dB between -40 and 40"},
              preset.keys_db);
  read_by_key(root, reader,
              {.name = "flattening_cents",
               .example = "[[48, 8], [96, 6]]",
               .point = "[key, cents]",
               .least = {0.0, -100.0},
               .most = {127.0, 100.0},
               .bounds = "a key lies between 0 and 127, its cents between -100 and 100"},
              preset.flattening_cents);
  read_keys(root, reader, preset);
  if (std::string budget; reader.text("budget", budget)) {
    if (const auto parsed = parse_budget(budget)) {
      preset.budget = *parsed;
    } else {
      reader.fail(*root.get("budget"), "'budget': " + parsed.error().message);
    }
  }
  if (std::string precision; reader.text("precision", precision)) {
    if (const auto named = precision_named(precision)) {
      preset.precision = *named;
    } else {
      reader.fail(*root.get("precision"), "'precision' must be double or float");
    }
  }
  if (std::string tuning; reader.text("tuning", tuning)) {
    preset.keyboard = tuning == "keyboard";
    if (!preset.keyboard && tuning != "fixed") {
      reader.fail(*root.get("tuning"), "'tuning' must be keyboard or fixed");
    }
  }
  if (!preset.keyboard && !preset.keys_db.empty()) {
    reader.fail(*root.get("keys_db"),
                "'keys_db' has no effect with tuning = \"fixed\", where all keys play the same "
                "note; remove one of them");
  }
  if (std::string motion; reader.text("motion", motion)) {
    if (motion == "velocity") {
      preset.third = ThirdArgument::velocity_per_second;
    } else if (motion == "delayed") {
      preset.third = ThirdArgument::delayed_position;
    } else {
      reader.fail(*root.get("motion"), "'motion' must be velocity or delayed");
    }
  }
  if (const toml::node* node = root.get("parameters")) {
    if (const toml::table* table = node->as_table()) {
      for (const auto& [key, row] : *table) {
        read_parameter(std::string(key.str()), row, preset, errors);
      }
    } else {
      reader.fail(*node, "'parameters' must be a table: [parameters]");
    }
  }
  if (const toml::node* node = root.get("morph")) {
    read_morph(*node, preset, errors);
  }
  if (const toml::node* node = root.get("variation")) {
    if (const toml::table* table = node->as_table()) {
      TomlTable variation(*table, "the variation", errors);
      variation.allow("variation");
      variation.number("strength", preset.varied_strength, 0.0, 1.0);
      variation.number("timing_ms", preset.varied_ms, 0.0, 50.0);
    } else {
      reader.fail(*node, "'variation' must be a table: { strength = 0.05, timing_ms = 5 }");
    }
  }
  if (const toml::node* node = root.get("lfo")) {
    const toml::array* rows = node->as_array();
    if (rows == nullptr || !rows->is_homogeneous<toml::table>() || rows->size() > most_lfos) {
      reader.fail(*node, "write each LFO as a table of its own, up to 8: [[lfo]]");
    } else {
      for (const toml::node& row : *rows) {
        read_lfo(*row.as_table(), preset, errors);
      }
    }
  }
  if (const toml::node* node = root.get("control")) {
    const toml::array* rows = node->as_array();
    if (rows == nullptr || !rows->is_homogeneous<toml::table>()) {
      reader.fail(*node, "write each control as a table of its own: [[control]]");
    } else {
      for (const toml::node& row : *rows) {
        read_control(*row.as_table(), preset, errors, is_reserved);
      }
    }
  }
}

}  // namespace

std::string word_of(std::string_view name) {
  std::string word(name);
  std::ranges::transform(word, word.begin(), [](unsigned char c) {
    return c == ' ' ? '-' : static_cast<char>(std::tolower(c));
  });
  return word;
}

std::vector<double> curve_keys(const ControlSetting& control) {
  std::set<double> keys;
  for (const auto* const points :
       {&control.range_keys, &control.travel_keys, &control.level_keys, &control.length_keys}) {
    for (const KeyPair& point : *points) {
      keys.insert(point[0]);
    }
  }
  return {keys.begin(), keys.end()};
}

ControlSetting on_key(ControlSetting control, double key) {
  const auto take = [&](const std::vector<KeyPair>& points, double& low, double& high) {
    if (!points.empty()) {
      const KeyPair pair = pair_on(points, key);
      low = pair[1];
      high = pair[2];
    }
  };
  double same_travel = 0.0;
  take(control.range_keys, control.low, control.high);
  take(control.travel_keys, control.travel, same_travel);
  take(control.level_keys, control.low_db, control.high_db);
  take(control.length_keys, control.longest_ms, control.shortest_ms);
  return control;
}

std::string curve_text(const Preset& preset, std::string_view parameter) {
  std::string text;
  const auto add = [&](const char* name, const std::vector<CurvePoint>& points) {
    for (const CurvePoint& point : points) {
      text += &point != &points.front() ? ", " : text.empty() ? name : std::string("; ") + name;
      text += print_number(point[0]) + ": " + print_number(point[1]);
    }
  };
  for (const ParameterSetting& setting : preset.parameters) {
    if (setting.name == parameter) {
      add("keys ", setting.keys);
      text += setting.keys_at ? " at " + print_number(*setting.keys_at) : "";
      add("velocity ", setting.velocity);
    }
  }
  return text;
}

ParsedPreset parse_preset(std::string_view text, IsReserved is_reserved) {
  ParsedPreset read;
  const auto parsed = parse_toml(text);
  if (!parsed) {
    read.errors.push_back(parsed.error());
    return read;
  }
  read_root(*parsed, read.preset, read.errors, is_reserved);
  std::ranges::sort(read.preset.parameters,
                    [](const auto& a, const auto& b) { return a.name < b.name; });
  std::ranges::stable_sort(read.errors, [](const Error& a, const Error& b) {
    return std::pair(a.line, a.column) < std::pair(b.line, b.column);
  });
  if (read.errors.size() > most_preset_errors) {
    read.errors[most_preset_errors].message = "too many errors; stopping here";
    read.errors.resize(most_preset_errors + 1);
  }
  return read;
}

}  // namespace ressort::model
