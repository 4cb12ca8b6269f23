// app/commands: a description as JSON, as a page of text and as a picture.
#pragma once

#include <string>

#include "app/commands/timbre/description.h"

namespace ressort::commands {

// Writes one object to stdout, as app/README.md lays it out; a frame's row at a time, as there may
// be hundreds of thousands of them.
void print_json(const Description& description, const DescriptionOptions& options);

// For people: the words that musicians have, then every figure.
std::string to_text(const Description& description, const DescriptionOptions& options);

// The spectrum of the loudest frame with its centroid, spread and rolloff, and their course.
std::string description_svg(const Description& description, const DescriptionOptions& options);

}  // namespace ressort::commands
