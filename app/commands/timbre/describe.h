// app/commands: what a sound file, a model or a preset sounds like, in figures. The exit code comes
// back.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "app/commands/timbre/description.h"
#include "core/compile/stability_check.h"
#include "core/model/network.h"

namespace ressort::commands {

// A parameter that goes from one value to another in so many steps, by equal ratios or differences.
struct SweptParameter {
  std::string name;
  double first = 0.0;
  double last = 1.0;
  int steps = 25;
  bool by_ratios = false;
};

// What a figure is said to be, as a formula of what is swept, to be drawn beside what it is.
struct FigureLaw {
  std::string figure;
  std::string formula;
};

struct DescribeOptions {
  std::string name;  // a sound file, a model or a preset
  // An .svg; of a sweep a .csv as well or instead. Empty: none; of a sweep a table to stdout.
  std::vector<std::string> outputs;
  bool force = false;  // write over a file that is there
  bool as_json = false;
  DescriptionOptions how;
  std::size_t modes = 0;     // of a sound: as many as are looked for, to tell their T60
  double rate_hz = 44100.0;  // of models and presets, as render has it
  int key = 57;              // of presets: the note that is rendered,
  double seconds = 3.0;      // for so long; it is held for two thirds of that
  std::optional<ThirdArgument> third;
  std::vector<Setting> settings;      // of a model or a preset
  std::vector<SweptParameter> swept;  // not empty: all of their values with each other
  std::vector<std::string> figures;   // that the picture of a sweep shows
  std::vector<FigureLaw> laws;        // the same
};

// Of one sound; `progress` answers false to stop, `warn` gets what a person should know.
Result<Description> description_of(const DescribeOptions& options,
                                   const DescriptionProgress& progress,
                                   const std::function<void(const std::string&)>& warn);

// A sound file is read as it is. A preset is rendered, one note. A model without a preset is told
// from its modes, if it is linear. `goes_on` answers false to stop. [main]
int describe(const DescribeOptions& options, const std::function<bool()>& goes_on);

}  // namespace ressort::commands
