#include "core/model/preset/edit.h"

#include <algorithm>

#include "core/model/language/expression.h"
#include "core/model/preset/toml.h"
#include "core/ranges.h"

namespace ressort::model {

std::string source_name(const ControlSetting& control) {
  switch (control.source) {
    case ControlSource::note:
      return "note";
    case ControlSource::controller:
      return "cc" + std::to_string(control.number);
    case ControlSource::pressure:
      return "pressure";
    case ControlSource::osc:
    case ControlSource::lfo:
      return control.address;
    case ControlSource::audio:
      return "audio" + std::to_string(control.number);
    case ControlSource::release:
      return "release";
  }
  return "";
}

std::string in_quotes(std::string_view text) {
  std::string quoted = "\"";
  for (const char c : text) {
    quoted += c == '"' || c == '\\' ? std::string{'\\', c} : std::string(1, c);
  }
  return quoted + "\"";
}

namespace {

// Prints a number that TOML does not read as an integer.
std::string in_toml(double number) {
  std::string text = print_number(number);
  return text.find_first_of(".e") == text.npos ? text + ".0" : text;
}

std::string pair(double low, double high) {
  return "[" + in_toml(low) + ", " + in_toml(high) + "]";
}

std::string print_parameter(const ParameterSetting& setting) {
  return setting.name + " = { value = " + in_toml(setting.value) +
         ", range = " + pair(setting.minimum, setting.maximum) + " }\n";
}

std::string print_control(const ControlSetting& control) {
  const ControlSetting usual;
  std::string text = "\n[[control]]\nfrom = " + in_quotes(source_name(control)) +
                     "\nto = " + in_quotes(control.target) + "\n";
  text += control.name.empty() ? "" : "name = " + in_quotes(control.name) + "\n";
  text += control.help.empty() ? "" : "help = " + in_quotes(control.help) + "\n";
  if (control.gesture != Gesture::parameter) {
    text += "how = " + in_quotes(row_of(control.gesture).name) + "\n";
  }
  text += "range = " + pair(control.low, control.high) + "\n";
  text += control.in_swings ? "unit = \"swing\"\n" : "";
  text += control.exponential ? "curve = \"exponential\"\n" : "";
  text += control.travel != usual.travel ? "travel = " + in_toml(control.travel) + "\n" : "";
  text += control.has_level ? "level_db = " + pair(control.low_db, control.high_db) + "\n" : "";
  if (control.longest_ms != usual.longest_ms || control.shortest_ms != usual.shortest_ms) {
    text += "length_ms = " + pair(control.longest_ms, control.shortest_ms) + "\n";
  }
  text += control.follows_pitch ? "" : "follows_pitch = false\n";
  text += control.noise != usual.noise ? "noise = " + in_toml(control.noise) + "\n" : "";
  if (control.low_hz != usual.low_hz || control.high_hz != usual.high_hz) {
    text += "band_hz = " + pair(control.low_hz, control.high_hz) + "\n";
  }
  if (control.lowest_key != usual.lowest_key || control.highest_key != usual.highest_key) {
    text += "keys = [" + std::to_string(control.lowest_key) + ", " +
            std::to_string(control.highest_key) + "]\n";
  }
  if (control.turns != usual.turns) {
    text += "round_robin = [" + std::to_string(control.turn) + ", " +
            std::to_string(control.turns) + "]\n";
  }
  return text;
}

// A range of the text and its replacement.
struct Edit {
  std::size_t first = 0;
  std::size_t count = 0;
  std::string text;
};

class Editor {
 public:
  explicit Editor(std::string_view text) : text_(text) {
    starts_.push_back(0);
    for (std::size_t i = 0; i < text.size(); ++i) {
      if (text[i] == '\n') {
        starts_.push_back(i + 1);
      }
    }
  }

  void replace(const toml::node& node, const std::string& text) {
    const std::size_t first = offset(node.source().begin);
    edits_.push_back({first, offset(node.source().end) - first, text});
  }

  // Inserts lines after the line in which a node begins.
  void insert_after(const toml::node& node, const std::string& lines) {
    edits_.push_back({line_start(node.source().begin.line + 1), 0, lines});
  }

  std::string result() {
    std::ranges::stable_sort(edits_, {}, &Edit::first);
    std::string all;
    std::size_t at = 0;
    for (const Edit& edit : edits_) {
      if (edit.first >= at) {
        all += text_.substr(at, edit.first - at);
        if (edit.count == 0 && !all.empty() && all.back() != '\n' && !edit.text.empty()) {
          all += '\n';
        }
        all += edit.text;
        at = edit.first + edit.count;
      }
    }
    return all + std::string(text_.substr(at));
  }

 private:
  std::size_t line_start(std::size_t line) const {
    return line <= starts_.size() ? starts_[line - 1] : text_.size();
  }
  // Converts a position to an offset. Columns count UTF-8 characters, not bytes.
  std::size_t offset(const toml::source_position& position) const {
    std::size_t at = line_start(position.line);
    for (toml::source_index column = 1; column < position.column && at < text_.size(); ++column) {
      do {
        ++at;
      } while (at < text_.size() && (static_cast<unsigned char>(text_[at]) & 0xC0U) == 0x80U);
    }
    return at;
  }

  std::string_view text_;
  std::vector<std::size_t> starts_;  // offsets of lines
  std::vector<Edit> edits_;
};

std::string edit(std::string_view text, const PresetChanges& changes) {
  const toml::parse_result parsed = toml::parse(text);
  const toml::table& root = parsed.table();
  Editor editor(text);
  const toml::node* const model = root.get("model");
  editor.replace(*model, in_quotes(changes.model));
  if (const toml::array* const through = root.get_as<toml::array>("through")) {
    for (std::size_t i = 0; i < std::min(through->size(), changes.through.size()); ++i) {
      if ((*through)[i].value_or(std::string()) != changes.through[i]) {
        editor.replace((*through)[i], in_quotes(changes.through[i]));
      }
    }
  }
  if (const toml::node* const gain = root.get("gain"); gain == nullptr) {
    editor.insert_after(*model, "gain = " + in_toml(changes.gain) + "\n");
  } else if (gain->value_or(0.0) != changes.gain) {
    editor.replace(*gain, in_toml(changes.gain));
  }
  const toml::table* const parameters = root.get_as<toml::table>("parameters");
  std::string more;
  for (const ParameterSetting& setting : changes.parameters) {
    const toml::table* const row =
        parameters != nullptr ? parameters->get_as<toml::table>(setting.name) : nullptr;
    if (row == nullptr) {
      more += print_parameter(setting);
    } else if (const toml::node* const value = row->get("value");
               value != nullptr && value->value_or(0.0) != setting.value) {
      const bool moves_curve = row->get("keys") != nullptr && row->get("keys_at") == nullptr;
      editor.replace(*value, in_toml(setting.value) +
                                 (!moves_curve       ? ""
                                  : row->is_inline() ? ", keys_at = "
                                                     : "\nkeys_at = ") +
                                 (moves_curve ? in_toml(value->value_or(0.0)) : ""));
    }
  }
  std::string end;
  if (parameters != nullptr && !more.empty()) {
    editor.insert_after(*parameters, more);
  } else if (!more.empty()) {
    end += "\n[parameters]\n" + more;
  }
  std::string result = editor.result();
  result += result.ends_with('\n') || end.empty() ? "" : "\n";
  return result + end;
}

}  // namespace

Result<std::string> edit_preset(std::string_view toml, const PresetChanges& changes) {
  if (!parse_preset(toml).ok()) {
    return Error{"this is not a preset"};
  }
  std::string text = edit(toml, changes);
  const ParsedPreset written = parse_preset(text);
  if (!written.ok()) {
    return Error{"cannot change this preset: " + written.errors.front().message};
  }
  return text;
}

std::string print_preset(const Preset& preset) {
  const Preset usual;
  std::string text = "model = " + in_quotes(preset.model) + "\n";
  if (!preset.description.empty()) {
    text += "description = " + in_quotes(preset.description) + "\n";
  }
  text += "voices = " + std::to_string(preset.voices) + "\ngain = " + in_toml(preset.gain) + "\n";
  text += preset.damper_s != usual.damper_s ? "damper_s = " + in_toml(preset.damper_s) + "\n" : "";
  text += preset.noise ? "noise = true\n" : "";
  text += preset.keyboard ? "" : "tuning = \"fixed\"\n";
  const std::string fixed = joined(preset.fixed, ", ", in_quotes);
  text += fixed.empty() ? "" : "fixed = [" + fixed + "]\n";
  text += preset.transpose != 0 ? "transpose = " + std::to_string(preset.transpose) + "\n" : "";
  if (!preset.parameters.empty()) {
    text += "\n[parameters]\n";
  }
  for (const ParameterSetting& setting : preset.parameters) {
    text += print_parameter(setting);
  }
  for (const ControlSetting& control : preset.controls) {
    text += print_control(control);
  }
  return text;
}

}  // namespace ressort::model
