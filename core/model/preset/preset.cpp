#include "core/model/preset/preset.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdio>

#include "core/model/language/tokens.h"
#include "core/model/preset/toml.h"
#include "core/model/preset/toml_depth.h"
#include "core/model/topology.h"

namespace ressort {
namespace {

// clang-format off
constexpr PresetKey keys[] = {
    {"", "model", "text", "the model's file, `NAME.mdl`, beside the preset or in the folder of the models; needed"},
    {"", "description", "text", "one line for the person who loads it"},
    {"", "voices", "1 to 256 (1)", "how many notes sound at once"},
    {"", "gain", "0 to 1e9 (1)", "output per unit of position; a forte note should peak at -6 dBFS"},
    {"", "release_s", "0 to 60 (0)", "how long a note fades once its key is up; 0 lets it ring out"},
    {"", "noise", "true or false (false)", "the outputs shape white noise instead of being heard themselves"},
    {"", "tuning", "`keyboard` or `fixed` (`keyboard`)", "whether a key sets the pitch, or every key sounds the model as it is written"},
    {"", "transpose", "-96 to 96 (0)", "semitones between a key and the pitch that it sets"},
    {"", "motion", "`velocity` or `delayed`", "what the last argument of a mass means, whatever the model says"},
    {"", "budget", "text", "how exact, as `--budget` takes it: `cents=3 t60=5 silence=-60 passive=auto`"},
    {"", "parameters", "a table", "the model's parameters by name"},
    {"", "control", "tables, one for each `[[control]]`", "what plays the model"},
    {"parameters", "value", "a number", "what the parameter is at first; needed"},
    {"parameters", "range", "[low, high]", "between what it may be turned; needed"},
    {"control", "from", "text", "`note`, `pressure`, `cc0` to `cc119`, `audio1` to `audio64`, or an OSC name such as `/finger`; needed"},
    {"control", "to", "text", "an input, such as `in1`, or a parameter; needed"},
    {"control", "how", "see below", "without it an input is moved and a parameter is turned"},
    {"control", "range", "[low, high] ([0, 1])", "what the softest and the loudest become: positions, forces, a parameter's values, or speeds per sample at 44 100 Hz"},
    {"control", "curve", "`linear` or `exponential` (`linear`)", "exponential: equal steps are equal ratios"},
    {"control", "travel", "above 0", "of a pluck, which needs it: how far from the string the finger rests, on either side"},
    {"control", "keys", "[low, high] ([0, 127])", "of notes: which keys"},
};
// clang-format on

using IsReserved = bool (*)(std::string_view address);

// "position, pluck, bow, impulse, hold or parameter"
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

SourceLocation location_of(const toml::node& node) {
  return {static_cast<int>(node.source().begin.line), static_cast<int>(node.source().begin.column)};
}

// Takes values out of one table, and goes on after a problem so that all are told at once. What
// takes a value says whether it is there and right; what is wrong has been told.
class Table {
 public:
  Table(const toml::table& table, std::string name, std::vector<Error>& errors)
      : table_(table), name_(std::move(name)), errors_(errors) {}

  // Every key of the table must be one that `keys` has for it.
  void allow(std::string_view table) {
    for (const auto& [key, value] : table_) {
      bool is_known = false;
      std::string expected;
      for (const PresetKey& known : keys) {
        if (known.table == table) {
          is_known |= known.key == key.str();
          expected += (expected.empty() ? "" : ", ") + std::string(known.key);
        }
      }
      if (!is_known) {
        fail(value,
             "unknown key " + quoted(key.str()) + " in " + name_ + "; there are " + expected);
      }
    }
  }

  bool number(std::string_view key, double& target, double least, double most) {
    const toml::node* node = table_.get(key);
    return node != nullptr && number(*node, key, target, least, most);
  }

  void integer(std::string_view key, int& target, int least, int most) {
    double value = target;
    if (number(key, value, least, most) && value != std::floor(value)) {
      fail(*table_.get(key), "'" + std::string(key) + "' must be a whole number");
    }
    target = static_cast<int>(value);
  }

  bool text(std::string_view key, std::string& target) {
    return take(key, target, "a text in quotes");
  }
  bool flag(std::string_view key, bool& target) { return take(key, target, "true or false"); }

  // [low, high]
  bool pair(std::string_view key, double& low, double& high, double least = -1e12,
            double most = 1e12) {
    const toml::node* node = table_.get(key);
    if (node == nullptr) {
      return false;
    }
    const toml::array* both = node->as_array();
    if (both == nullptr || both->size() != 2) {
      return fail(*node, "'" + std::string(key) + "' must be two numbers: [low, high]");
    }
    const bool is_first = number((*both)[0], key, low, least, most);
    return number((*both)[1], key, high, least, most) && is_first;
  }
  // The same, and not the other way round.
  bool range(std::string_view key, double& low, double& high, double least = -1e12,
             double most = 1e12) {
    if (!pair(key, low, high, least, most)) {
      return false;
    }
    return low <= high || fail(*table_.get(key), "'" + std::string(key) +
                                                     "' is the wrong way round: the lower number "
                                                     "comes first, [low, high]");
  }

  const toml::node* get(std::string_view key) const { return table_.get(key); }

  // Always false, for who has failed.
  bool fail(const toml::node& node, std::string message) {
    return fail(location_of(node), std::move(message));
  }
  bool fail(SourceLocation location, std::string message) {
    errors_.push_back({std::move(message), location.line, location.column});
    return false;
  }

 private:
  bool number(const toml::node& node, std::string_view key, double& target, double least,
              double most) {
    const auto value = node.value<double>();
    if (!value || node.is_boolean() || !std::isfinite(*value)) {
      return fail(node, "'" + std::string(key) + "' must be a number");
    }
    if (*value < least || *value > most) {
      char range[80];
      std::snprintf(range, sizeof range, "must lie between %g and %g", least, most);
      return fail(node, "'" + std::string(key) + "' " + range);
    }
    target = *value;
    return true;
  }

  template <class T>
  bool take(std::string_view key, T& target, std::string_view expected) {
    const toml::node* node = table_.get(key);
    if (node == nullptr) {
      return false;
    }
    if (!node->is<T>()) {
      return fail(*node, "'" + std::string(key) + "' must be " + std::string(expected));
    }
    target = *node->value<T>();
    return true;
  }

  const toml::table& table_;
  std::string name_;
  std::vector<Error>& errors_;
};

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
  Table reader(*row, "the parameter " + shown, errors);
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
  preset.parameters.push_back(std::move(setting));
}

// Whether a message, or a line of a score, can have this address.
bool is_address(std::string_view text) {
  constexpr std::size_t longest = 255;
  return text.size() > 1 && text.size() <= longest && text[0] == '/' &&
         std::all_of(text.begin(), text.end(), [](char c) {
           constexpr std::string_view meant_otherwise = "#*,?[]{}";
           return c > ' ' && c <= '~' && meant_otherwise.find(c) == std::string_view::npos;
         });
}

// "note", "pressure", "cc1", "audio2", "/name"
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

// Without a word the target tells: an input is moved, a parameter is turned.
Gesture usual_gesture(std::string_view target) {
  return target.starts_with("in") && target.size() > 2 &&
                 std::isdigit(static_cast<unsigned char>(target[2])) != 0
             ? Gesture::position
             : Gesture::parameter;
}

void read_control(const toml::table& table, Preset& preset, std::vector<Error>& errors,
                  IsReserved is_reserved) {
  const std::size_t before = errors.size();
  Table reader(table, "a control", errors);
  reader.allow("control");
  ControlSetting control{.location = location_of(table)};
  std::string from;
  if ((reader.text("from", from) || table.get("from") == nullptr) && !read_source(from, control)) {
    const toml::node* node = table.get("from");
    reader.fail(node != nullptr ? *node : table,
                "'from' must be \"note\", \"pressure\", \"cc0\" to \"cc119\", \"audio1\", "
                "or an OSC name such as \"/finger\"");
  }
  if (control.source == ControlSource::osc && !is_address(control.address)) {
    reader.fail(*table.get("from"),
                "an OSC name has 2 to 255 characters: '/', then letters, digits and signs, but no "
                "blanks and none of # * , ? [ ] { }");
  } else if (control.source == ControlSource::osc && is_reserved != nullptr &&
             is_reserved(control.address)) {
    reader.fail(*table.get("from"), quoted(control.address) +
                                        " is an address of the program's own; choose another, such "
                                        "as \"/finger\"");
  }
  if ((reader.text("to", control.target) || table.get("to") == nullptr) && control.target.empty()) {
    reader.fail(table, "a control needs 'to': an input such as \"in1\" or a parameter");
  }
  control.gesture = usual_gesture(control.target);
  if (std::string how; reader.text("how", how)) {
    const auto* row = std::find_if(
        std::begin(gestures), std::end(gestures),
        [&](const GestureRow& gesture) { return gesture.name == how && !gesture.does.empty(); });
    if (row != std::end(gestures)) {
      control.gesture = row->gesture;
    } else {
      reader.fail(*table.get("how"), "'how' must be " + words_for_how());
    }
  }
  const bool has_range = reader.pair("range", control.low, control.high);
  const bool has_travel = reader.number("travel", control.travel, 0.0, 1e12);
  double lowest = 0.0;
  double highest = 127.0;
  if (reader.range("keys", lowest, highest, 0.0, 127.0)) {
    control.lowest_key = static_cast<int>(lowest);
    control.highest_key = static_cast<int>(highest);
  }
  std::string curve = "linear";
  if (reader.text("curve", curve) && curve != "exponential" && curve != "linear") {
    reader.fail(*table.get("curve"), "'curve' must be linear or exponential");
  }
  control.exponential = curve == "exponential";
  if (control.exponential && (has_range || table.get("range") == nullptr) &&
      !(control.low > 0.0 && control.high > 0.0)) {
    reader.fail(table, "an exponential curve needs a range above 0");
  }
  const GestureRow& gesture = row_of(control.gesture);
  if (!gesture.needs_travel.empty() && (has_travel || table.get("travel") == nullptr) &&
      !(control.travel > 0.0)) {
    reader.fail(table, "a " + std::string(gesture.name) +
                           " needs 'travel': " + std::string(gesture.needs_travel));
  }
  if (errors.size() == before) {
    preset.controls.push_back(std::move(control));
  }
}

void read_root(const toml::table& root, Preset& preset, std::vector<Error>& errors,
               IsReserved is_reserved) {
  Table reader(root, "a preset", errors);
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
    reader.fail(preset.model_location, "'model' is longer than any file's path");
    preset.model.clear();
  } else if (!preset.model.empty() && !preset.model.ends_with(".mdl")) {
    reader.fail(preset.model_location, "'model' must be the name of a .mdl file");
    preset.model.clear();
  }
  reader.text("description", preset.description);
  reader.integer("voices", preset.voices, 1, max_voices);
  reader.number("gain", preset.gain, 0.0, 1e9);
  reader.number("release_s", preset.release_s, 0.0, 60.0);
  reader.flag("noise", preset.noise);
  reader.integer("transpose", preset.transpose, -96, 96);
  if (std::string budget; reader.text("budget", budget)) {
    if (const auto parsed = parse_budget(budget)) {
      preset.budget = *parsed;
    } else {
      reader.fail(*root.get("budget"), "'budget': " + parsed.error().message);
    }
  }
  if (std::string tuning; reader.text("tuning", tuning)) {
    preset.keyboard = tuning == "keyboard";
    if (!preset.keyboard && tuning != "fixed") {
      reader.fail(*root.get("tuning"), "'tuning' must be keyboard or fixed");
    }
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
  if (const toml::node* node = root.get("control")) {
    const toml::array* rows = node->as_array();
    if (rows == nullptr || !rows->is_homogeneous<toml::table>()) {
      reader.fail(*node, "controls are written one by one: [[control]]");
    } else {
      for (const toml::node& row : *rows) {
        read_control(*row.as_table(), preset, errors, is_reserved);
      }
    }
  }
}

bool is_linked(const Network& network, std::uint32_t mass, Family family, double& scale) {
  const auto parameters = parameter_values(network);
  for (const Link& link : network.links) {
    const LawFacts& law = facts_of(link.law);
    if (law.family == family && (link.a == mass || link.b == mass)) {
      scale = argument_value(network, link.arguments[law.slot(Role::reach)], parameters);
      return true;
    }
  }
  return false;
}

bool never_moves(const Mass& mass) {
  return mass.kind == MassKind::ground || mass.kind == MassKind::position;
}

// What a force could strike, as a line refers to it; empty where nothing moves.
std::string something_to_strike(const Network& network) {
  for (const Mass& mass : network.masses) {
    if (moves(mass)) {
      return "@" + mass.name.text();
    }
  }
  return network.macros.empty() ? ""
                                : "[@" + network.macros[0].name +
                                      (is_mesh(network.macros[0].kind) ? " 0.3 0.4]" : " 0.3]");
}

}  // namespace

std::span<const PresetKey> preset_keys() {
  return keys;
}

ParsedPreset parse_preset(std::string_view text, IsReserved is_reserved) {
  ParsedPreset read;
  if (text.size() > max_preset_bytes) {
    read.errors.push_back({"the preset is longer than 64 KiB", 1, 1});
    return read;
  }
  if (auto error = too_deep(text)) {
    read.errors.push_back(*std::move(error));
    return read;
  }
  const toml::parse_result parsed = toml::parse(text);
  if (!parsed) {
    const auto& begin = parsed.error().source().begin;
    read.errors.push_back({std::string(parsed.error().description()), static_cast<int>(begin.line),
                           static_cast<int>(begin.column)});
    return read;
  }
  read_root(parsed.table(), read.preset, read.errors, is_reserved);
  std::sort(read.preset.parameters.begin(), read.preset.parameters.end(),
            [](const auto& a, const auto& b) { return a.name < b.name; });
  std::stable_sort(read.errors.begin(), read.errors.end(), [](const Error& a, const Error& b) {
    return std::pair(a.line, a.column) < std::pair(b.line, b.column);
  });
  if (read.errors.size() > most_preset_errors) {
    read.errors[most_preset_errors].message = "too many problems; those after this are not told";
    read.errors.resize(most_preset_errors + 1);
  }
  return read;
}

Preset default_preset(const Network& network, bool bare) {
  Preset preset;
  preset.keyboard = !bare;
  bool first = true;
  for (const Input& input : network.inputs) {
    ControlSetting note{.target = "in" + std::to_string(input.number)};
    const double middle = network.masses[input.mass].position;
    double scale = 0.0;
    bool played = !input.is_force || !never_moves(network.masses[input.mass]);
    if (input.is_force) {
      note.gesture = Gesture::impulse;
      note.low = 0.01;
      note.high = 0.1;
    } else if (is_linked(network, input.mass, Family::pluck, scale)) {
      note.gesture = Gesture::pluck;
      note.travel = 5.0 * scale;
      // The slower the finger, the more it gives to the string before that slips away.
      note.low = 0.3 * scale;
      note.high = 0.05 * scale;
      note.exponential = true;
    } else if (is_linked(network, input.mass, Family::bow, scale)) {
      note.gesture = Gesture::bow;
      note.low = 0.35 * scale;
      note.high = 0.9 * scale;
    } else {
      played = false;
    }
    if (played && (first || bare)) {
      preset.controls.push_back(note);
      first = false;
    }
    if (!input.is_force && !bare) {
      const double reach = note.travel > 0.0 ? note.travel : 1.0;
      ControlSetting wheel{.source = ControlSource::controller,
                           .number = 1,
                           .target = note.target,
                           .low = middle - reach,
                           .high = middle + reach};
      if (played && note.gesture == Gesture::pluck) {
        preset.controls.push_back(wheel);
      }
    }
    if (bare || !played) {
      preset.controls.push_back({.source = ControlSource::audio,
                                 .number = input.number,
                                 .target = note.target,
                                 .low = 0.0,
                                 .high = 1.0});
    }
  }
  return preset;
}

std::optional<Error> idle_keys(const Network& network, const Preset& preset) {
  constexpr std::size_t most_told = 3;
  const std::string target = something_to_strike(network);
  if (target.empty() || std::any_of(preset.controls.begin(), preset.controls.end(),
                                    [](const ControlSetting& control) {
                                      return control.source == ControlSource::note;
                                    })) {
    return std::nullopt;
  }
  std::string why;
  for (std::size_t i = 0; i < std::min(most_told, network.inputs.size()); ++i) {
    const Input& input = network.inputs[i];
    why += (i == 0 ? "" : ", ") + ("'@in" + std::to_string(input.number)) +
           (input.is_force ? "' pushes what never moves" : "' moves no pluck and no bow");
  }
  if (network.inputs.size() > most_told) {
    why += ", nor do " + std::to_string(network.inputs.size() - most_told) + " more";
  }
  int next = input_count(network) + 1;
  for (const Parameter& parameter : network.parameters) {
    next = std::max(next, parameter.audio_input + 1);
  }
  const SourceLocation location =
      network.inputs.empty() ? SourceLocation{1, 1} : network.inputs[0].location;
  return Error{"no key plays this model: " + (why.empty() ? "it has no input" : why) + "; '@in" +
                   std::to_string(next) + " frcInput " + target + "' would let keys strike it",
               location.line, location.column};
}

}  // namespace ressort
