// app/commands: a picture of what was identified in a recording. Pure.
#pragma once

#include <string>

#include "app/rooms.h"
#include "core/identification/identify.h"

namespace ressort::commands {

// An SVG: the recording's spectrum with a mark for each mode where its own peak is, how long each
// rings, and the spectrum of what the modes leave.
std::string recording_picture(const Identification& found, const std::string& title);

}  // namespace ressort::commands
