#include "app/session/flight/flight_recorder.h"

#include <ctime>
#include <filesystem>
#include <system_error>
#include <utility>

#include "app/session/files.h"

namespace ressort::session {
namespace {

constexpr std::uint64_t burst_xruns = 3;  // within a second
constexpr int most_saved = 8;             // flights saved after problems, in one run

std::string time_stamp() {
  const std::time_t now = std::time(nullptr);
  std::tm local{};
  localtime_r(&now, &local);
  char text[32];
  std::strftime(text, sizeof text, "%Y%m%d-%H%M%S", &local);
  return text;
}

}  // namespace

FlightRecorder::FlightRecorder(Process& process, FlightSetup setup, bool is_on)
    : process_(process), is_on_(is_on), log_(std::move(setup)) {
  if (is_on_) {
    process_.keeps_flight.raise();
  }
}

void FlightRecorder::add(FlightEngine engine, bool has_audio_inputs) {
  if (is_on_) {
    const std::lock_guard lock(mutex_);
    log_.add(std::move(engine), has_audio_inputs);
  }
}

std::optional<std::string> FlightRecorder::collect(const Meters& now) {
  using namespace std::chrono_literals;
  if (!is_on_) {
    return std::nullopt;
  }
  bool has_begun = false;
  {
    const std::lock_guard lock(mutex_);
    log_.drain(process_);
    has_begun = log_.has_begun();
  }
  const auto time = std::chrono::steady_clock::now();
  const bool has_reset = std::exchange(resets_seen_, now.resets) != now.resets;
  bool has_burst = false;
  if (time - xruns_time_ >= 1s) {
    has_burst = now.xruns - std::exchange(xruns_seen_, now.xruns) >= burst_xruns;
    xruns_time_ = time;
  }
  // A starting server may miss periods before anything sounds.
  if (!(has_reset || has_burst) || !has_begun || time - save_time_ < 60s || saved_ == most_saved) {
    return std::nullopt;
  }
  save_time_ = time;
  ++saved_;
  const auto saved = save((has_reset ? "runaway-" : "xruns-") + time_stamp());
  return saved ? "the flight until now is saved as " + *saved
               : "the flight until now could not be saved: " + saved.error().message;
}

Result<std::string> FlightRecorder::write(const std::string& path, Existing existing) {
  if (!is_on_) {
    return Error{"flights are not recorded here"};
  }
  std::optional<Flight> flight;
  {
    const std::lock_guard lock(mutex_);
    log_.drain(process_);
    auto now = log_.flight();
    if (!now) {
      return now.error();
    }
    flight = *std::move(now);
  }
  const auto written = write_text(path, print_flight(*flight), existing);
  return written ? Result<std::string>(path) : written.error();
}

Result<std::string> FlightRecorder::save(const std::string& name) {
  const auto path = path_of_flight(name);
  if (std::error_code error; path && std::filesystem::exists(*path, error)) {
    return Error{"'" + name + "' exists already; type 'flight " + *path +
                 " --force' at the console to overwrite it"};
  }
  return path ? write(*path, Existing::refuse) : path;
}

}  // namespace ressort::session
