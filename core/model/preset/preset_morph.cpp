#include "core/model/preset/preset_morph.h"

#include <string>

#include "core/model/language/tokens.h"
#include "core/model/preset/toml_table.h"

namespace ressort::model {
namespace {

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

}  // namespace

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
    reader.fail(node, "a morph needs a name for its parameter: parameter = \"morph\"");
  }
  const toml::node* const through = table->get("through");
  const toml::array* const stops = through != nullptr ? through->as_array() : nullptr;
  if (stops == nullptr || stops->size() < 2 || stops->size() > most_morph_stops) {
    reader.fail(through != nullptr ? *through : node,
                "a morph needs 2 to 16 presets or values to go through: through = [\"Soft\", "
                "{ m_K = 0.1 }]");
    return;
  }
  for (const toml::node& stop : *stops) {
    if (const toml::table* const values = stop.as_table()) {
      preset.morph.push_back(read_values(*values, errors));
    } else if (const auto name = stop.value<std::string>(); name && !name->empty()) {
      preset.morph.push_back({.preset = *name, .location = location_of(stop)});
    } else {
      reader.fail(stop, "a morph goes through names of presets and tables of values");
    }
  }
  for (const MorphSetting& stop : preset.morph) {
    for (const ParameterSetting& value : stop.values) {
      for (const ParameterSetting& knob : preset.parameters) {
        if (knob.name == value.name) {
          reader.fail(value.location, quoted(value.name) +
                                          " is a knob, as [parameters] names it, so the morph "
                                          "cannot turn it; leave one of the two out");
        }
      }
    }
  }
}

}  // namespace ressort::model
