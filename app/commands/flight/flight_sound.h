// app/commands: renders a flight to a sound file or for playing.
#pragma once

#include <functional>

#include "app/commands/flight/flight_player.h"
#include "app/commands/offline.h"

namespace ressort::commands {

// Renders the last `seconds` of the flight that `name` refers to (default flight_heard_s), like
// render().
Result<Rendered> render_flight(const RenderOptions& options,
                               const std::function<bool(double)>& progress);

// Renders the same samples for playing by a Process.
Result<SampleTape> tape_of(const FlightPlayer& player, const std::function<bool(double)>& progress);

}  // namespace ressort::commands
