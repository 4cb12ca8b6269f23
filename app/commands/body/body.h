// app/commands: makes a body, a thing that can be struck, of what a file holds. The exit code comes
// back.
#pragma once

#include <cstddef>
#include <string>

namespace ressort {

struct BodyOptions {
  std::string input;
  std::string output;   // a file; empty: to stdout
  std::string picture;  // a file; empty: none
  bool force = false;   // write over files that are there
  bool as_json = false;
  std::size_t most_modes = 400;
  // Of recordings.
  double floor_db = -70.0;  // of a mode's energy, below that of the one with most
  double mass = 40.0;       // of every mode
};

// The ending of the input's name says what it is. [main]
int body_command(const BodyOptions& options);

// Of a recording. [main]
int recording_body(const BodyOptions& options);

}  // namespace ressort
