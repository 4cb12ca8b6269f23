// app/session: what is written of a player's changes.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "app/rooms.h"
#include "core/compile/instrument.h"
#include "core/model/preset/preset.h"

namespace ressort::session {

// The parameters that the preset has, or that are not as they start, with their ranges. `values`
// are what they are now. [parameter]
std::vector<ParameterSetting> changed_settings(const std::vector<ParameterInfo>& parameters,
                                               const Preset& preset,
                                               std::span<const double> values);

// How a preset that stands elsewhere names a model: by its name where that leads to it from there
// too, else by its whole path. Blocks on the disk.
std::string model_name_elsewhere(const std::string& model_path);

}  // namespace ressort::session
