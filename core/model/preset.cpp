#include "core/model/preset.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <initializer_list>

#define TOML_EXCEPTIONS 0
#include <toml++/impl/preprocessor.h>
// toml++ 3.3 asserts, and in a release build has the compiler assume, what its parser then goes on
// to report as an error, such as the header "[?]".
#undef TOML_ASSERT_ASSUME
#define TOML_ASSERT_ASSUME(expression) static_assert(true)
#include <toml++/toml.h>

namespace ressort {
namespace {

struct Choice {
  std::string_view word;
  ControlGesture gesture;
};

constexpr Choice gestures[] = {
    {"position", ControlGesture::position}, {"pluck", ControlGesture::pluck},
    {"bow", ControlGesture::bow},           {"impulse", ControlGesture::impulse},
    {"hold", ControlGesture::hold},         {"parameter", ControlGesture::parameter},
};

Place place_of(const toml::node& node) {
  return {static_cast<int>(node.source().begin.line), static_cast<int>(node.source().begin.column)};
}

// Takes values out of one table and keeps the first problem.
class Table {
 public:
  Table(const toml::table& table, std::string name, std::optional<Error>& error)
      : table_(table), name_(std::move(name)), error_(error) {}

  // Every key of the table must be one of these.
  void allow(std::initializer_list<std::string_view> keys) {
    for (const auto& [key, value] : table_) {
      if (std::find(keys.begin(), keys.end(), key.str()) == keys.end()) {
        std::string expected;
        for (const std::string_view k : keys) {
          expected += (expected.empty() ? "" : ", ") + std::string(k);
        }
        fail(value, "unknown key '" + std::string(key.str()) + "' in " + name_ + "; there are " +
                        expected);
        return;
      }
    }
  }

  void number(std::string_view key, double& target, double least, double most) {
    const toml::node* node = table_.get(key);
    if (node == nullptr) {
      return;
    }
    number(*node, key, target, least, most);
  }

  void integer(std::string_view key, int& target, int least, int most) {
    double value = target;
    number(key, value, least, most);
    if (value != std::floor(value)) {
      fail(*table_.get(key), "'" + std::string(key) + "' must be a whole number");
    }
    target = static_cast<int>(value);
  }

  void text(std::string_view key, std::string& target) { take(key, target, "a text in quotes"); }
  void flag(std::string_view key, bool& target) { take(key, target, "true or false"); }

  // [low, high]
  bool pair(std::string_view key, double& low, double& high) {
    const toml::node* node = table_.get(key);
    if (node == nullptr) {
      return false;
    }
    const toml::array* both = node->as_array();
    if (both == nullptr || both->size() != 2) {
      fail(*node, "'" + std::string(key) + "' must be two numbers: [low, high]");
      return false;
    }
    number((*both)[0], key, low, -1e12, 1e12);
    number((*both)[1], key, high, -1e12, 1e12);
    return true;
  }

  const toml::node* get(std::string_view key) const { return table_.get(key); }

  void fail(const toml::node& node, std::string message) {
    const Place place = place_of(node);
    fail(place, std::move(message));
  }
  void fail(Place place, std::string message) {
    if (!error_) {
      error_ = Error{std::move(message), place.line, place.column};
    }
  }

 private:
  void number(const toml::node& node, std::string_view key, double& target, double least,
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
  }

  template <class T>
  void take(std::string_view key, T& target, std::string_view expected) {
    const toml::node* node = table_.get(key);
    if (node == nullptr) {
      return;
    }
    if (!node->is<T>()) {
      return fail(*node, "'" + std::string(key) + "' must be " + std::string(expected));
    }
    target = *node->value<T>();
  }

  const toml::table& table_;
  std::string name_;
  std::optional<Error>& error_;
};

void read_parameters(const toml::table& table, Preset& preset, std::optional<Error>& error) {
  for (const auto& [key, node] : table) {
    ParameterSetting setting{.name = std::string(key.str()), .place = place_of(node)};
    const toml::table* row = node.as_table();
    Table reader(row != nullptr ? *row : table, "the parameter '" + setting.name + "'", error);
    if (row == nullptr) {
      return reader.fail(
          node, "'" + setting.name + "' must be a table: { value = 0.1, range = [0.001, 0.3] }");
    }
    reader.allow({"value", "range"});
    if (row->get("value") == nullptr || row->get("range") == nullptr) {
      return reader.fail(node, "'" + setting.name + "' needs a value and a range");
    }
    reader.number("value", setting.value, -1e12, 1e12);
    reader.pair("range", setting.minimum, setting.maximum);
    if (!error && !(setting.minimum <= setting.value && setting.value <= setting.maximum)) {
      reader.fail(node, "the value of '" + setting.name + "' lies outside its range");
    }
    preset.parameters.push_back(std::move(setting));
  }
  std::sort(preset.parameters.begin(), preset.parameters.end(),
            [](const auto& a, const auto& b) { return a.name < b.name; });
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
  } else if (text.size() > 1 && text[0] == '/') {
    control.source = ControlSource::osc;
    control.address = std::string(text);
  } else {
    return false;
  }
  return true;
}

void read_control(const toml::table& table, Preset& preset, std::optional<Error>& error) {
  Table reader(table, "a control", error);
  reader.allow({"from", "to", "how", "range", "curve", "travel", "keys"});
  ControlSetting control{.place = place_of(table)};
  std::string from;
  std::string how;
  std::string curve = "linear";
  reader.text("from", from);
  reader.text("to", control.target);
  reader.text("how", how);
  reader.text("curve", curve);
  if (error) {
    return;
  }
  if (!read_source(from, control)) {
    const toml::node* node = table.get("from");
    return reader.fail(node != nullptr ? *node : table,
                       "'from' must be \"note\", \"pressure\", \"cc0\" to \"cc119\", \"audio1\", "
                       "or an OSC name such as \"/finger\"");
  }
  if (control.target.empty()) {
    return reader.fail(table, "a control needs 'to': an input such as \"in1\" or a parameter");
  }
  const auto* choice = std::find_if(std::begin(gestures), std::end(gestures),
                                    [&](const Choice& c) { return c.word == how; });
  if (choice != std::end(gestures)) {
    control.gesture = choice->gesture;
  } else if (how.empty()) {
    control.gesture = control.target.starts_with("in") && control.target.size() > 2 &&
                              std::isdigit(static_cast<unsigned char>(control.target[2])) != 0
                          ? ControlGesture::position
                          : ControlGesture::parameter;
  } else {
    return reader.fail(*table.get("how"),
                       "'how' must be position, pluck, bow, impulse, hold or parameter");
  }
  reader.pair("range", control.low, control.high);
  reader.number("travel", control.travel, 0.0, 1e12);
  double lowest = 0.0;
  double highest = 127.0;
  if (reader.pair("keys", lowest, highest)) {
    control.lowest_key = static_cast<int>(std::clamp(lowest, 0.0, 127.0));
    control.highest_key = static_cast<int>(std::clamp(highest, 0.0, 127.0));
  }
  control.exponential = curve == "exponential";
  if (!control.exponential && curve != "linear") {
    return reader.fail(*table.get("curve"), "'curve' must be linear or exponential");
  }
  if (control.exponential && !(control.low > 0.0 && control.high > 0.0)) {
    return reader.fail(table, "an exponential curve needs a range above 0");
  }
  if (control.gesture == ControlGesture::pluck && !(control.travel > 0.0)) {
    return reader.fail(table, "a pluck needs 'travel': how far from the string the finger rests");
  }
  preset.controls.push_back(std::move(control));
}

bool is_linked(const Network& network, std::uint32_t mass, LinkKind kind, double& scale) {
  const auto parameters = parameter_values(network);
  for (const Link& link : network.links) {
    const bool same =
        link.kind == kind || (kind == LinkKind::bow && link.kind == LinkKind::smooth_bow);
    if (same && (link.a == mass || link.b == mass)) {
      scale = argument_value(network, link.arguments[1], parameters);
      return true;
    }
  }
  return false;
}

}  // namespace

Result<Preset> parse_preset(std::string_view text) {
  if (text.size() > max_preset_bytes) {
    return Error{"the preset is longer than 1 MiB", 1, 1};
  }
  const toml::parse_result parsed = toml::parse(text);
  if (!parsed) {
    const auto& begin = parsed.error().source().begin;
    return Error{std::string(parsed.error().description()), static_cast<int>(begin.line),
                 static_cast<int>(begin.column)};
  }
  const toml::table& root = parsed.table();
  std::optional<Error> error;
  Preset preset;
  Table reader(root, "a preset", error);
  reader.allow({"model", "description", "voices", "gain", "release_s", "noise", "tuning",
                "transpose", "parameters", "control"});
  reader.text("model", preset.model);
  reader.text("description", preset.description);
  reader.integer("voices", preset.voices, 1, max_voices);
  reader.number("gain", preset.gain, 0.0, 1e9);
  reader.number("release_s", preset.release_s, 0.0, 60.0);
  reader.flag("noise", preset.noise);
  reader.integer("transpose", preset.transpose, -96, 96);
  std::string tuning = "keyboard";
  reader.text("tuning", tuning);
  preset.keyboard = tuning == "keyboard";
  if (!error && !preset.keyboard && tuning != "fixed") {
    reader.fail(*root.get("tuning"), "'tuning' must be keyboard or fixed");
  }
  if (!error && preset.model.empty()) {
    reader.fail(Place{1, 1}, "a preset needs a model: model = \"PolyTriangle.mdl\"");
  }
  if (const toml::node* node = root.get("parameters")) {
    if (const toml::table* table = node->as_table()) {
      read_parameters(*table, preset, error);
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
        read_control(*row.as_table(), preset, error);
      }
    }
  }
  if (error) {
    return *error;
  }
  return preset;
}

Preset default_preset(const Network& network, bool bare) {
  Preset preset;
  preset.keyboard = !bare;
  bool first = true;
  for (const Input& input : network.inputs) {
    ControlSetting note{.target = "in" + std::to_string(input.number)};
    const double middle = network.masses[input.mass].position;
    double scale = 0.0;
    bool played = true;
    if (input.is_force) {
      note.gesture = ControlGesture::impulse;
      note.low = 0.01;
      note.high = 0.1;
    } else if (is_linked(network, input.mass, LinkKind::pluck, scale)) {
      note.gesture = ControlGesture::pluck;
      note.travel = 5.0 * scale;
      note.low = 0.005 * scale;
      note.high = 0.1 * scale;
    } else if (is_linked(network, input.mass, LinkKind::bow, scale)) {
      note.gesture = ControlGesture::bow;
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
      if (played && note.gesture == ControlGesture::pluck) {
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

}  // namespace ressort
