// core/model: the [morph] of a preset's TOML.
#pragma once

#include <vector>

#include "core/model/preset/preset.h"
#include "core/model/preset/toml.h"

namespace ressort::model {

// Adds what is wrong, each with its place.
void read_morph(const toml::node& node, Preset& preset, std::vector<Error>& errors);

}  // namespace ressort::model
