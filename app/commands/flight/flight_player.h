// app/commands: replays a recorded flight: the same samples as during the performance.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "app/commands/offline.h"
#include "app/realtime/process.h"
#include "app/session/flight/flight.h"
#include "core/result.h"

namespace ressort::commands {

class FlightPlayer {
 public:
  // Reads the file. Errors have its line. Only the last `heard_s` are played.
  static Result<FlightPlayer> open(const std::string& path, double heard_s);

  double rate_hz() const { return rate_hz_; }
  std::size_t channels() const { return channels_; }
  // length of the played part
  std::int64_t frames() const { return flight_.end_frame - heard_from_; }
  // Returns reasons why the sound may differ from the performance.
  std::vector<std::string> warnings() const;

  // Replays the whole flight. `hear` gets the interleaved samples of the played part, chunk by
  // chunk. `progress` gets 0..1 and returns false to stop. Fails if an engine cannot be created or
  // if events are out of order. [any thread but audio]
  Result<Done> play(const std::function<Result<Done>(std::span<const float>)>& hear,
                    const std::function<bool(double)>& progress) const;

 private:
  explicit FlightPlayer(Flight flight, double heard_s);

  Flight flight_;
  double rate_hz_ = 0.0;
  std::size_t channels_ = 0;
  std::int64_t heard_from_ = 0;  // frame
};

// Renders the last `seconds` of the flight that `name` refers to (default flight_heard_s), like
// render().
Result<Rendered> render_flight(const RenderOptions& options,
                               const std::function<bool(double)>& progress);

// Renders the same samples for playing by a Process.
Result<SampleTape> tape_of(const FlightPlayer& player, const std::function<bool(double)>& progress);

}  // namespace ressort::commands
