// app/commands: a description as JSON, as text and as a figure.
#pragma once

#include <string>

#include "app/commands/timbre/description.h"
#include "app/plot/plot.h"

namespace ressort::commands {

// Prints one JSON object, frame by frame, since there may be hundreds of thousands.
void print_json(const Description& description, const DescriptionOptions& options);

// Returns a text for people: all figures in a table.
std::string to_text(const Description& description, const DescriptionOptions& options);

// The spectrum of the loudest frame with its centroid, spread and rolloff, and these over time.
plot::Figure description_figure(const Description& description, const DescriptionOptions& options);

}  // namespace ressort::commands
