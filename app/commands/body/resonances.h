// app/commands: converts a resonance model, a list of modes by frequency, amplitude and bandwidth
// as Modalys and CNMAT's tools write them, to a modal body.
#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "app/commands/body/body.h"

namespace ressort::commands {

struct Resonance {
  double frequency_hz = 0.0;
  double amplitude = 0.0;     // of the decaying sine that an impulse makes
  double bandwidth_hz = 0.0;  // between the points 3 dB below the peak
};

// Parses lines of three numbers, or of four with a running index first. ';' and '#' start comments.
// Returns nothing for any other text. Sorted by frequency.
std::optional<std::vector<Resonance>> parse_resonances(std::string_view text);

// Writes the body, with modes of the given mass. Returns the exit code. [main]
int resonance_body(const std::vector<Resonance>& resonances, const BodyOptions& options,
                   double mass);

}  // namespace ressort::commands
