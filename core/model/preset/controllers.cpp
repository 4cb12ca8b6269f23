#include "core/model/preset/controllers.h"

#include <algorithm>
#include <charconv>

#include "core/midi_number.h"
#include "core/model/preset/edit.h"
#include "core/model/preset/toml_table.h"

namespace ressort::model {
namespace {

// clang-format off
constexpr PresetKey mapping_keys[] = {
    {"controller", "from", "text", "`cc0` to `cc119`, `nrpn 0` to `nrpn 16383`, or `note 0` to `note 127`; required"},
    {"controller", "to", "text", "the name of a parameter or of a control of the preset, `cc0` to `cc119`, `sustain`, or for a button `next`, `previous` (presets), `load NAME`, `load NUMBER` or `panic`; required"},
    {"controller", "mode", "`absolute`, `twos-complement`, `offset` or `sign-magnitude` (`absolute`)", "the last three are encoders, which send steps: a step up is 1, 65 or 1, a step down 127, 63 or 65. A step is 1/127 of the range"},
    {"controller", "bits", "7 or 14 (7; of an NRPN 14)", "14: `cc0` to `cc31` together with the controller 32 above it, or CC 6 and 38 of an NRPN"},
    {"controller", "pickup", "true or false (false)", "the knob acts once it has met or crossed the present value"},
    {"controller", "send", "true or false (false)", "the present value is sent to the port `midi_out`, for motor faders and rings of lights"},
    {"controller", "channel", "1 to 16 (all)", "the MIDI channel to receive; `send` uses it, or channel 1"},
};
// clang-format on

// Reads a number after a prefix and at most one blank; -1 if the text is different or out of range.
int number_after(std::string_view prefix, std::string_view text, int most) {
  if (!text.starts_with(prefix)) {
    return -1;
  }
  text.remove_prefix(prefix.size() + (text.substr(prefix.size()).starts_with(' ') ? 1 : 0));
  int number = -1;
  const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), number);
  const bool is_number = failure == std::errc{} && end == text.data() + text.size();
  return is_number && number >= 0 && number <= most ? number : -1;
}

struct SourceWord {
  ControllerSource source;
  const char* word;
  int most;
};
constexpr SourceWord source_words[] = {
    {ControllerSource::controller, "cc", 119},
    {ControllerSource::nrpn, "nrpn", 16383},
    {ControllerSource::note, "note", 127},
};

struct ModeWord {
  ControllerMode mode;
  const char* word;
};
constexpr ModeWord mode_words[] = {
    {ControllerMode::absolute, "absolute"},
    {ControllerMode::twos_complement, "twos-complement"},
    {ControllerMode::offset, "offset"},
    {ControllerMode::sign_magnitude, "sign-magnitude"},
};

// Returns whether a controller is a part of RPN and NRPN messages.
bool is_part_of_number(int controller) {
  return controller == 6 || controller == 38 || (controller >= 96 && controller <= 101);
}

class MappingReader {
 public:
  explicit MappingReader(ParsedControllers& read) : read_(read) {}

  void read(const toml::table& table) {
    const toml::node& at = table.get("from") != nullptr ? *table.get("from") : table;
    TomlTable reader(table, "a controller", read_.errors);
    reader.allow("controller", controller_keys());
    ControllerSetting setting;
    if (!read_from(reader, at, setting.input) || !read_target(reader, table, setting.target) ||
        !read_mode(reader, setting)) {
      return;
    }
    reader.flag("pickup", setting.input.picks_up);
    reader.flag("send", setting.input.sends);
    if (int channel = 0; table.get("channel") != nullptr) {
      reader.integer("channel", channel, 1, 16);
      setting.input.channel = static_cast<std::uint8_t>(channel - 1);
    }
    check_button(reader, at, setting);
    check_others(reader, at, setting.input);
    read_.rows.push_back(std::move(setting));
  }

 private:
  bool read_from(TomlTable& reader, const toml::node& at, ControllerInput& input) {
    std::string from;
    reader.text("from", from);
    for (const SourceWord& row : source_words) {
      if (const int number = number_after(row.word, from, row.most); number >= 0) {
        if (row.source == ControllerSource::controller && is_part_of_number(number)) {
          return reader.fail(at, quoted(from) +
                                     " is a part of RPN and NRPN messages; map the "
                                     "number, such as \"nrpn 1234\"");
        }
        input.source = row.source;
        input.number = static_cast<std::uint16_t>(number);
        input.has_14_bits = row.source == ControllerSource::nrpn;
        return true;
      }
    }
    return reader.fail(at,
                       "'from' must be \"cc0\" to \"cc119\", \"nrpn 0\" to \"nrpn 16383\", or "
                       "\"note 0\" to \"note 127\"");
  }

  bool read_target(TomlTable& reader, const toml::table& table, std::string& target) {
    if (!reader.text("to", target) || target.empty()) {
      const toml::node* const node = table.get("to");
      return reader.fail(node != nullptr ? *node : table,
                         "'to' must be the name of a parameter or control, \"cc0\" to \"cc119\", "
                         "sustain, next, previous, \"load NAME\" or panic");
    }
    return true;
  }

  // Reads the mode and the bits.
  bool read_mode(TomlTable& reader, ControllerSetting& setting) {
    ControllerInput& input = setting.input;
    if (std::string word; reader.text("mode", word)) {
      const auto* const row = std::ranges::find(mode_words, word, &ModeWord::word);
      if (row == std::end(mode_words)) {
        return reader.fail(*reader.get("mode"),
                           "'mode' must be absolute, twos-complement, offset or sign-magnitude");
      }
      input.mode = row->mode;
    }
    const bool is_relative = input.mode != ControllerMode::absolute;
    input.has_14_bits = input.has_14_bits && !is_relative;
    const toml::node* const node = reader.get("bits");
    int bits = input.has_14_bits ? 14 : 7;
    reader.integer("bits", bits, 7, 14);
    const bool can_have_14 = input.source == ControllerSource::nrpn ||
                             (input.source == ControllerSource::controller && input.number < 32);
    if (node != nullptr && ((bits != 7 && bits != 14) || (bits == 14 && !can_have_14))) {
      return reader.fail(*node, "'bits' must be 7, or 14 for cc0 to cc31 and for an NRPN");
    }
    if (bits == 14 && is_relative) {
      return reader.fail(*node, "an encoder sends steps of 7 bits; remove 'bits' or 'mode'");
    }
    input.has_14_bits = bits == 14;
    return true;
  }

  void check_button(TomlTable& reader, const toml::node& at, const ControllerSetting& setting) {
    const ControllerInput& input = setting.input;
    const bool is_relative = input.mode != ControllerMode::absolute;
    const bool is_note = input.source == ControllerSource::note;
    if (is_action(setting.target) && (is_relative || input.picks_up || input.sends)) {
      reader.fail(at, quoted(setting.target) +
                          " is an action of a button; 'mode', 'pickup' and "
                          "'send' have no effect on it");
    } else if (is_note && (is_relative || input.picks_up || input.sends)) {
      reader.fail(at, "'mode', 'pickup' and 'send' have no effect on a note; use a controller");
    }
  }

  // Reports an earlier row for the same messages.
  void check_others(TomlTable& reader, const toml::node& at, const ControllerInput& input) {
    const auto low_half = [](ControllerInput whole) {
      whole.number = static_cast<std::uint16_t>(whole.number + 32);
      return whole;
    };
    const auto is_half_of = [&](const ControllerInput& half, const ControllerInput& whole) {
      return whole.source == ControllerSource::controller && whole.has_14_bits &&
             half.is_same_source(low_half(whole));
    };
    for (const ControllerSetting& other : read_.rows) {
      if (input.is_same_source(other.input)) {
        reader.fail(at, name_of(input) + " is mapped twice; remove one of the rows");
      } else if (is_half_of(input, other.input) || is_half_of(other.input, input)) {
        reader.fail(at, name_of(input) + " and " + name_of(other.input) +
                            " are one controller of 14 bits; remove one of the rows");
      }
    }
  }

  ParsedControllers& read_;
};

std::string source_text(const ControllerInput& input) {
  const auto* const row = std::ranges::find(source_words, input.source, &SourceWord::source);
  return std::string(row->word) + (input.source == ControllerSource::controller ? "" : " ") +
         std::to_string(input.number);
}

std::string print_row(const ControllerSetting& setting) {
  const ControllerInput& input = setting.input;
  std::string text = "[[controller]]\nfrom = " + in_quotes(source_text(input)) +
                     "\nto = " + in_quotes(setting.target) + "\n";
  const bool is_relative = input.mode != ControllerMode::absolute;
  text += is_relative ? "mode = " + in_quotes(name_of(input.mode)) + "\n" : "";
  if (input.has_14_bits != (input.source == ControllerSource::nrpn && !is_relative)) {
    text += input.has_14_bits ? "bits = 14\n" : "bits = 7\n";
  }
  text += input.picks_up ? "pickup = true\n" : "";
  text += input.sends ? "send = true\n" : "";
  if (input.channel != ControllerInput::any_channel) {
    text += "channel = " + std::to_string(input.channel + 1) + "\n";
  }
  return text;
}

// Returns the comment of a line of TOML, from its '#' on.
std::string_view comment_of(std::string_view line) {
  char quote = 0;
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (quote == 0 && line[i] == '#') {
      return line.substr(i);
    }
    if (quote == '"' && line[i] == '\\') {
      ++i;
    } else if (line[i] == quote) {
      quote = 0;
    } else if (quote == 0 && (line[i] == '"' || line[i] == '\'')) {
      quote = line[i];
    }
  }
  return {};
}

}  // namespace

bool ControllerSetting::replaces(const ControllerSetting& other) const {
  return input.is_same_source(other.input) || word_of(target) == word_of(other.target);
}

bool is_action(std::string_view target) {
  return target == "next" || target == "previous" || target == "panic" ||
         target.starts_with("load ");
}

int controller_number(std::string_view target) {
  return target == "sustain" ? MidiNumber::sustain_pedal : number_after("cc", target, 119);
}

std::string name_of(const ControllerInput& input) {
  return source_text(input) + (input.channel == ControllerInput::any_channel
                                   ? ""
                                   : " on channel " + std::to_string(input.channel + 1));
}

std::string_view name_of(ControllerMode mode) {
  return std::ranges::find(mode_words, mode, &ModeWord::mode)->word;
}

std::span<const PresetKey> controller_keys() {
  return mapping_keys;
}

ParsedControllers parse_controllers(std::string_view text) {
  ParsedControllers read;
  const auto parsed = parse_toml(text);
  if (!parsed) {
    read.errors.push_back(parsed.error());
    return read;
  }
  MappingReader reader(read);
  for (const auto& [key, node] : *parsed) {
    const toml::array* const rows = node.as_array();
    if (key.str() != "controller" || rows == nullptr || !rows->is_homogeneous<toml::table>() ||
        rows->size() > most_controllers) {
      const SourceLocation at = location_of(node);
      read.errors.push_back(
          {"a mapping has only tables of the name [[controller]], up to 128", at.line, at.column});
      continue;
    }
    for (const toml::node& row : *rows) {
      reader.read(*row.as_table());
    }
  }
  return read;
}

Result<std::string> edit_controllers(
    std::string_view text, const std::function<bool(const ControllerSetting&)>& is_dropped,
    const std::optional<ControllerSetting>& added) {
  const ParsedControllers before = parse_controllers(text);
  if (!before.ok()) {
    return before.errors.front();
  }
  std::string block = added ? print_row(*added) : "";
  std::vector<ControllerSetting> wanted;
  std::string edited;
  std::size_t row = 0;  // rows whose headers were read
  bool drops = false;   // the current row
  for (std::string_view rest = text; !rest.empty();) {
    const std::size_t end = std::min(rest.find('\n'), rest.size() - 1) + 1;
    const std::string_view line = rest.substr(0, end);
    rest.remove_prefix(end);
    const std::size_t first = std::min(line.find_first_not_of(" \t\r\n"), line.size());
    const bool is_head = line.substr(first).starts_with("[[");
    if (is_head && row < before.rows.size()) {
      drops = is_dropped(before.rows[row]);
      if (!drops) {
        wanted.push_back(before.rows[row]);
      } else if (edited.ends_with("\n\n") && block.empty()) {
        edited.pop_back();
      }
      ++row;
    }
    edited += !drops || first == line.size() ? line : comment_of(line);
    if (is_head && drops && !block.empty()) {
      edited += std::exchange(block, "");
      wanted.push_back(*added);
    }
  }
  if (!block.empty()) {
    edited += (edited.empty() || edited.ends_with('\n') ? "" : "\n");
    edited += (edited.empty() ? "" : "\n") + block;
    wanted.push_back(*added);
  }
  const ParsedControllers after = parse_controllers(edited);
  if (!after.ok()) {
    return Error{after.errors.front().message};
  }
  return after.rows == wanted
             ? Result<std::string>(std::move(edited))
             : Error{"write each row as a table [[controller]] with lines of its own"};
}

}  // namespace ressort::model
