// app/commands: what was identified in a recording, as a model and for machines. Pure.
#pragma once

#include <string>

#include "app/rooms.h"
#include "core/identification/identify.h"

namespace ressort::commands {

// A label of the language out of a file's name: letters, digits and _; "body" if none is left.
std::string label_of_file(const std::string& path);

// A body with the place `hit` and one for each channel: `mic`, `left` and `right`, or `mic1` and so
// on; its modes, each with how uncertain it is; a force input and a position output for each
// channel.
std::string body_model(const Identification& found, const std::string& label,
                       const std::string& source, double mass);

// One object: modes, residual, warnings.
std::string identification_json(const Identification& found, double mass);

}  // namespace ressort::commands
