// app/commands: a model or a preset turned to the timbre that is asked for. The exit code comes
// back.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "app/rooms.h"
#include "core/analysis/timbre/ask.h"
#include "core/model/network.h"

namespace ressort::commands {

struct ShapeOptions {
  std::string name;    // a preset or a model
  std::string output;  // a .toml; empty: it is told alone
  bool force = false;  // write over a file that is there
  bool as_json = false;
  std::vector<TimbreTarget> targets;  // instead of what the sound file has
  std::string like;                   // a sound file; empty: none
  std::optional<int> key;             // of presets; without it A3, or the sound file's
  std::optional<double> rate_hz;      // without it 44100, or the sound file's
  std::optional<ThirdArgument> third;
};

// `goes_on` answers false to stop. [main]
int shape_model(const ShapeOptions& options, const std::function<bool()>& goes_on);

}  // namespace ressort::commands
