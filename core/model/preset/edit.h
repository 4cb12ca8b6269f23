// core/model: presets as texts that are written: what a player has changed, in the text that was
// loaded, or the whole of one that no text was loaded for.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/model/preset/preset.h"
#include "core/result.h"

namespace ressort::model {

struct PresetChanges {
  std::string model;  // its name or path, as a preset at its new place needs it
  double gain = 1.0;
  std::vector<ParameterSetting> parameters;  // that differ, or that the text does not have
  std::vector<ControlSetting> learned;       // each instead of all that its controller did
};

// The same text but for that: comments and all keys stay. An error where it is no preset, or is
// written in a way that cannot be changed. [any thread but audio]
Result<std::string> edit_preset(std::string_view toml, const PresetChanges& changes);

// A text that reads as this preset, for one that was made up by default_preset(). [any thread but
// audio]
std::string print_preset(const Preset& preset);

// What drives a control, as a preset says it: "note", "cc71", "/finger".
std::string source_name(const ControlSetting& control);

}  // namespace ressort::model
