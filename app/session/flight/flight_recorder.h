// app/session: records the flight of a session, and saves it on request or after a problem.
#pragma once

#include <chrono>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "app/session/flight/flight.h"
#include "app/session/new_file.h"

namespace ressort::session {

class FlightRecorder {
 public:
  // Limits. Beyond them, the beginning of the flight is lost.
  static constexpr std::size_t most_records = std::size_t{1} << 19;
  static constexpr std::size_t most_engines = 10'000;
  static constexpr std::size_t most_text_bytes = std::size_t{64} << 20;

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
  // Callers hold the lock.
  void read_records();
  bool has_begun() const;  // true once an engine has played
  // Returns the flight so far, or an error before the first engine and beyond the limits.
  Result<Flight> flight() const;
  void forget();

  Process& process_;
  const bool is_on_;
  std::mutex mutex_;  // guards all until lost_
  Flight flight_;
  std::deque<FlightRecord> records_;  // a deque, which grows without moving
  std::vector<std::shared_ptr<const std::vector<SceneFile>>> texts_;  // without duplicates
  std::size_t text_bytes_ = 0;
  std::string lost_;  // reason why the beginning is lost; empty: it is complete

  // [worker]
  std::uint64_t resets_seen_ = 0;
  std::uint64_t xruns_seen_ = 0;
  int saved_ = 0;  // flights saved after problems
  std::chrono::steady_clock::time_point xruns_time_;
  std::chrono::steady_clock::time_point save_time_;
};

}  // namespace ressort::session
