// core/model: writes presets: changes values in a preset's text, or prints a preset that has no
// text.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/model/preset/preset.h"
#include "core/result.h"

namespace ressort::model {

struct PresetChanges {
  std::string model;  // name or path of the model, relative to the new file
  double gain = 1.0;
  std::vector<ParameterSetting> parameters;  // changed or new
  std::vector<std::string> through = {};  // the models of `through`, as `model`; empty: unchanged
};

// Applies changes to a preset's text, and keeps its comments and all other keys. Fails if the text
// is not a preset, or has a form that cannot be changed. [any thread but audio]
Result<std::string> edit_preset(std::string_view toml, const PresetChanges& changes);

// Prints a preset made by default_preset(). [any thread but audio]
std::string print_preset(const Preset& preset);

// Returns a text as a string of TOML.
std::string in_quotes(std::string_view text);

// Returns the source of a control as in a preset: "note", "cc71", "/finger".
std::string source_name(const ControlSetting& control);

}  // namespace ressort::model
