// app/commands: adjusts the parameters of a model or a preset to reach a target timbre.
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
  std::string name;    // preset or model
  std::string output;  // .toml; empty: only prints the result
  bool force = false;  // overwrites an existing file
  bool as_json = false;
  std::vector<TimbreTarget> targets;  // override those of the sound file
  std::string like;                   // sound file; empty: none
  std::optional<int> key;             // key of presets; empty: A3, or the sound file's
  std::optional<double> rate_hz;      // empty: 44100, or the sound file's
  std::optional<ThirdArgument> third;
};

// `should_continue` returns false to stop. Returns the exit code. [main]
int shape_model(const ShapeOptions& options, const std::function<bool()>& should_continue);

}  // namespace ressort::commands
