// app/commands: the modes found in a recording, as a model and as JSON. Pure.
#pragma once

#include <string>

#include "app/rooms.h"
#include "core/identification/identify.h"

namespace ressort::commands {

// Makes a label of a file name, from its letters, digits and _; "body" if none is left.
std::string label_of_file(const std::string& path);

// Returns a model of a body with the place `hit` and one place per channel (`mic`, `left` and
// `right`, or `mic1` and so on), its modes with their standard deviations, a force input, and a
// position output per channel.
std::string body_model(const Identification& found, const std::string& label,
                       const std::string& source, double mass);

// Returns modes, residual and warnings as one JSON object.
std::string identification_json(const Identification& found, double mass);

}  // namespace ressort::commands
