// app/commands: makes a body, a thing that can be struck, of what a file holds: a recording, a
// solid, or another model. The exit code comes back.
#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "app/commands/body/solid.h"

namespace ressort::commands {

// Of recordings.
struct BodyOptions {
  std::string input;
  std::string output;   // a file; empty: to stdout
  std::string picture;  // a file; empty: none
  bool force = false;   // write over files that are there
  bool as_json = false;
  std::size_t most_modes = 400;
  double floor_db = -70.0;  // of a mode's energy, below that of the one with most
  double mass = 40.0;       // of every mode
};

// Of models.
struct NetworkBodyOptions {
  std::string input;
  std::string output;
  bool force = false;
  std::size_t modes = 0;  // the lowest; 0: all
  std::string chain;      // a place: masses and springs that answer there as the model does
};

// What the command line says, whatever the file is.
struct BodyRequest {
  BodyOptions recording;
  SolidBodyOptions solid;
  NetworkBodyOptions network;
  std::string input;
  std::string output;
  std::string picture;
  bool force = false;
  std::optional<int> modes;
};

// The ending of the input's name says what it is. [main]
int body_command(const BodyRequest& request);

// Of a recording, and of a model. [main]
int recording_body(const BodyOptions& options);
int network_body(const NetworkBodyOptions& options);

}  // namespace ressort::commands
