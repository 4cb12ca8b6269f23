// app/commands: a flight, played back: the same samples as were heard.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "app/realtime/process.h"
#include "app/session/flight/flight.h"
#include "core/result.h"

namespace ressort::commands {

class FlightPlayer {
 public:
  // Reads the file; an error has its line. `heard_s` are those of the end that shall be heard.
  static Result<FlightPlayer> open(const std::string& path, double heard_s);

  double rate_hz() const { return rate_hz_; }
  std::size_t channels() const { return channels_; }
  std::int64_t frames() const { return flight_.end_frame - heard_from_; }  // that are heard
  // Why it may not be what was heard; empty: it is.
  std::vector<std::string> warnings() const;

  // Computes all of it; `hear` gets the samples, interleaved, chunk by chunk, from where they are
  // to be heard on. `progress` gets 0..1 and answers false to stop. The error: an engine cannot be
  // made, or the events are out of their order. [any thread but audio]
  Result<Done> play(const std::function<Result<Done>(std::span<const float>)>& hear,
                    const std::function<bool(double)>& progress) const;

 private:
  explicit FlightPlayer(Flight flight, double heard_s);

  Flight flight_;
  double rate_hz_ = 0.0;
  std::size_t channels_ = 0;
  std::int64_t heard_from_ = 0;  // frame
};

}  // namespace ressort::commands
