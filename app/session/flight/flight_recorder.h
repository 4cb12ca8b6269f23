// app/session: records the flight of a session, and saves it on request or after a problem.
#pragma once

#include <chrono>
#include <mutex>
#include <optional>
#include <string>

#include "app/session/flight/flight.h"
#include "app/session/new_file.h"

namespace ressort::session {

class FlightRecorder {
 public:
  FlightRecorder(Process& process, FlightSetup setup, bool is_on);

  // Adds the next engine, before it is offered. [worker]
  void add(FlightEngine engine, bool has_audio_inputs);
  // Collects what was played. Saves the flight after a burst of xruns or an unstable voice, and
  // returns a message about it. [worker]
  std::optional<std::string> collect(const Meters& now);

  // Writes the flight. Returns its path. [any thread but audio]
  Result<std::string> write(const std::string& path, Existing existing);
  // Saves the flight in the user's folder; never overwrites. [any thread but audio]
  Result<std::string> save(const std::string& name);

 private:
  Process& process_;
  const bool is_on_;
  std::mutex mutex_;  // guards the log
  FlightLog log_;

  // [worker]
  std::uint64_t resets_seen_ = 0;
  std::uint64_t xruns_seen_ = 0;
  int saved_ = 0;  // flights saved after problems
  std::chrono::steady_clock::time_point xruns_time_;
  std::chrono::steady_clock::time_point save_time_;
};

}  // namespace ressort::session
