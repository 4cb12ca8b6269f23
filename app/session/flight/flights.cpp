// Flights of what a session plays: on command, and by themselves when something goes wrong.
#include <ctime>
#include <filesystem>
#include <system_error>
#include <utility>

#include "app/session/files.h"
#include "app/session/session.h"

namespace ressort::session {
namespace {

constexpr std::uint64_t burst_xruns = 3;  // within a second
constexpr int most_saved_flights = 8;     // by themselves, in one run of the program

std::string moment() {
  const std::time_t now = std::time(nullptr);
  std::tm local{};
  localtime_r(&now, &local);
  char text[32];
  std::strftime(text, sizeof text, "%Y%m%d-%H%M%S", &local);
  return text;
}

}  // namespace

Result<std::string> Session::write_flight(const std::string& path, Existing existing) {
  if (!options_.keeps_flights) {
    return Error{"no flight is kept of what is played here"};
  }
  std::optional<Flight> flight;
  {
    const std::lock_guard lock(mutex_);
    flight_.drain(process_);
    auto now = flight_.flight();
    if (!now) {
      return now.error();
    }
    flight = *std::move(now);
  }
  const auto written = write_text(path, print_flight(*flight), existing);
  return written ? Result<std::string>(path) : written.error();
}

Result<std::string> Session::save_flight(const std::string& name) {
  const auto path = path_of_flight(name);
  if (std::error_code error; path && std::filesystem::exists(*path, error)) {
    return Error{"'" + name + "' is there already; 'flight " + *path +
                 " --force' at the console writes over it"};
  }
  return path ? write_flight(*path, Existing::refuse) : path;
}

// Collects what was played; a burst of xruns, or a voice that ran away, is worth a file.
void Session::look_out(const Meters& now) {
  using namespace std::chrono_literals;
  if (!options_.keeps_flights) {
    return;
  }
  bool has_begun = false;
  {
    const std::lock_guard lock(mutex_);
    flight_.drain(process_);
    has_begun = flight_.has_begun();
  }
  const auto time = std::chrono::steady_clock::now();
  const bool has_reset = std::exchange(resets_seen_, now.resets) != now.resets;
  bool has_burst = false;
  if (time - last_look_ >= 1s) {
    has_burst = now.xruns - std::exchange(xruns_seen_, now.xruns) >= burst_xruns;
    last_look_ = time;
  }
  // As a server starts, it may miss periods before there is anything to be heard.
  if (!(has_reset || has_burst) || !has_begun || time - last_flight_ < 60s ||
      saved_flights_ == most_saved_flights) {
    return;
  }
  last_flight_ = time;
  ++saved_flights_;
  const auto saved = save_flight((has_reset ? "runaway-" : "xruns-") + moment());
  if (tell_) {
    tell_(saved ? "what was played until then is kept in " + *saved
                : "what was played until then is not kept: " + saved.error().message);
  }
}

}  // namespace ressort::session
