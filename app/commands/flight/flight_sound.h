// app/commands: a flight as a sound file, or as sound to be played.
#pragma once

#include <functional>

#include "app/commands/flight/flight_player.h"
#include "app/commands/offline.h"

namespace ressort::commands {

// Of a RenderOptions whose name is a flight's: its last `seconds`, or flight_heard_s. As render().
Result<Rendered> render_flight(const RenderOptions& options,
                               const std::function<bool(double)>& progress);

// The same samples, to be played by a Process.
Result<SampleTape> tape_of(const FlightPlayer& player, const std::function<bool(double)>& progress);

}  // namespace ressort::commands
