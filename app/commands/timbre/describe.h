// app/commands: what a sound file, a model or a preset sounds like, in figures. The exit code comes
// back.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "app/commands/timbre/description.h"
#include "core/model/network.h"

namespace ressort {

struct DescribeOptions {
  std::string name;     // a sound file, a model or a preset
  std::string picture;  // an .svg; empty: none
  bool force = false;   // write over a file that is there
  bool as_json = false;
  DescriptionOptions how;
  std::size_t modes = 0;     // of a sound: as many as are looked for, to tell their T60
  double rate_hz = 44100.0;  // of models and presets, as render has it
  int key = 57;              // of presets: the note that is rendered,
  double seconds = 3.0;      // for so long; it is held for two thirds of that
  std::optional<ThirdArgument> third;
};

// A sound file is read as it is. A preset is rendered, one note. A model without a preset is told
// from its modes, if it is linear. `goes_on` answers false to stop. [main]
int describe(const DescribeOptions& options, const std::function<bool()>& goes_on);

}  // namespace ressort
