// app/commands: measures the timbre of a sound file, a model or a preset.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "app/commands/timbre/description.h"
#include "core/compile/stability_check.h"
#include "core/model/network.h"

namespace ressort::commands {

// A range of a parameter, in steps of equal ratios or differences.
struct SweptParameter {
  std::string name;
  double first = 0.0;
  double last = 1.0;
  int steps = 25;
  bool by_ratios = false;
};

// A formula of the swept parameters that is plotted beside a figure.
struct FigureLaw {
  std::string figure;
  std::string formula;
};

struct DescribeOptions {
  std::string name;  // a sound file, a model or a preset
  // .svg files; of a sweep also .csv files. Empty: none, or the table of a sweep on stdout.
  std::vector<std::string> outputs;
  bool force = false;  // overwrites existing files
  bool as_json = false;
  DescriptionOptions how;
  std::size_t modes = 0;     // sound files: number of modes whose T60 is printed
  double rate_hz = 44100.0;  // sample rate of models and presets
  int key = 57;              // presets: the rendered note
  double seconds = 3.0;      // presets: length; the key is held for two thirds
  std::optional<ThirdArgument> third;
  std::vector<Setting> settings;      // parameters of a model or a preset
  std::vector<SweptParameter> swept;  // all combinations of their values
  std::vector<std::string> figures;   // plotted for a sweep
  std::vector<FigureLaw> laws;        // plotted for a sweep
};

// Analyses one sound. `progress` returns false to stop; `warn` gets warnings.
Result<Description> description_of(const DescribeOptions& options,
                                   const DescriptionProgress& progress,
                                   const std::function<void(const std::string&)>& warn);

// Analyses a sound file, one rendered note of a preset, or the modes of a linear model.
// `should_continue` returns false to stop. Returns the exit code. [main]
int describe(const DescribeOptions& options, const std::function<bool()>& should_continue);

}  // namespace ressort::commands
