// app/commands: makes a modal body from a recording, a solid, a model or statistics. Functions
// return the exit code.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "app/commands/body/solid.h"
#include "app/commands/body/statistical.h"

namespace ressort::commands {

// Options for recordings.
struct BodyOptions {
  std::string input;
  std::vector<std::string> others;  // more recordings of the same object
  std::string output;               // empty: stdout
  std::string picture;              // .svg; empty: none
  std::string listen;               // folder for sounds; empty: none
  bool force = false;               // overwrites existing files
  bool as_json = false;
  std::optional<std::size_t> modes;  // all that stand above the noise if not given
  double floor_db = -70.0;           // energy of the weakest mode, relative to the strongest
  double mass = 40.0;                // mass of every mode
};

// Options for models.
struct NetworkBodyOptions {
  std::string input;
  std::string output;
  bool force = false;
  std::size_t modes = 0;  // number, from the lowest; 0: all
  std::string chain;      // place whose response a chain gets; empty: no chain
};

// Options of the command line for all kinds of bodies.
struct BodyRequest {
  BodyOptions recording;
  SolidBodyOptions solid;
  NetworkBodyOptions network;
  StatisticalBodyOptions statistical;
  std::string input;  // empty: from statistics
  std::string output;
  std::string picture;
  bool force = false;
  std::optional<int> modes;
  double mass = 40.0;
  std::vector<CurvePoint> loss;  // loss factor; empty: that of the material
  // Given options that only some inputs use: name, and the input of its group in the help.
  std::vector<std::pair<std::string, std::string>> particular;
};

// Selects the kind of body by the file's content; models by their extension. [main]
int body_command(const BodyRequest& request);

// Convert a recording and a model. [main]
int recording_body(const BodyOptions& options);
int network_body(const NetworkBodyOptions& options);

}  // namespace ressort::commands
