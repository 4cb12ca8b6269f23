#include "app/session/flight/flight_recorder.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <system_error>
#include <utility>

#include "app/session/files.h"
#include "app/version.h"

namespace ressort::session {
namespace {

constexpr std::uint64_t burst_xruns = 3;  // within a second
constexpr int most_saved = 8;             // flights saved after problems, in one run

// Returns the time and the process, so that programs that play together write different files.
std::string time_stamp() {
  const std::time_t now = std::time(nullptr);
  std::tm local{};
  localtime_r(&now, &local);
  char text[32];
  std::strftime(text, sizeof text, "%Y%m%d-%H%M%S", &local);
  return text + ("-" + std::to_string(getpid()));
}

}  // namespace

FlightRecorder::FlightRecorder(Process& process, FlightSetup setup, bool is_on)
    : process_(process), is_on_(is_on) {
  flight_.setup = std::move(setup);
  if (is_on_) {
    process_.keeps_flight.raise();
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
    read_records();
    has_begun = this->has_begun();
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
  return saved ? "the flight so far is saved as " + *saved
               : "the flight so far could not be saved: " + saved.error().message;
}

Result<std::string> FlightRecorder::write(const std::string& path, Existing existing) {
  if (!is_on_) {
    return Error{"flights are not recorded here"};
  }
  std::optional<Flight> flight;
  {
    const std::lock_guard lock(mutex_);
    read_records();
    auto now = this->flight();
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

void FlightRecorder::add(FlightEngine engine, bool has_audio_inputs) {
  if (!is_on_) {
    return;
  }
  const std::lock_guard lock(mutex_);
  // Repeated loads of a scene share one text.
  const auto known = std::ranges::find_if(texts_, [&](const auto& files) {
    return std::equal(files->begin(), files->end(), engine.files->begin(), engine.files->end(),
                      [](const SceneFile& a, const SceneFile& b) {
                        return a.path == b.path && a.text == b.text && a.is_there == b.is_there;
                      });
  });
  if (known != texts_.end()) {
    engine.files = *known;
  } else {
    texts_.push_back(engine.files);
    for (const SceneFile& file : *engine.files) {
      text_bytes_ += file.text.size();
    }
  }
  flight_.has_audio_inputs = flight_.has_audio_inputs || has_audio_inputs;
  if (text_bytes_ > most_text_bytes) {
    lost_ = "the texts of the loaded models are too long for a flight";
  } else if (flight_.engines.size() >= most_engines) {
    lost_ = "models have been loaded more than " + std::to_string(most_engines) + " times";
  }
  if (lost_.empty()) {
    flight_.engines.push_back(std::move(engine));
  } else {
    forget();
  }
}

void FlightRecorder::read_records() {
  const auto end = static_cast<std::int64_t>(process_.board.read().frames);
  FlightRecord record;
  for (std::size_t left = process_.flight.size(); left > 0 && process_.flight.pop(record); --left) {
    if (record.kind == FlightRecord::Kind::gap) {
      lost_ = "events were lost during a long load";
    } else if (records_.size() >= most_records) {
      lost_ = "more than " + std::to_string(most_records) + " events have been played";
    }
    // Engines ignore NaN and infinity.
    const bool is_number = std::isfinite(record.event.value) && std::isfinite(record.event.value2);
    if (lost_.empty() && is_number) {
      records_.push_back(record);
    } else if (!lost_.empty()) {
      forget();
    }
  }
  flight_.end_frame = end;
}

void FlightRecorder::forget() {
  records_ = {};
  flight_.engines = {};
  texts_ = {};
}

bool FlightRecorder::has_begun() const {
  return !lost_.empty() || std::ranges::any_of(records_, [](const FlightRecord& record) {
    return record.kind == FlightRecord::Kind::take;
  });
}

Result<Flight> FlightRecorder::flight() const {
  if (!lost_.empty()) {
    return Error{lost_ + "; restart ressort to begin a new flight"};
  }
  if (!has_begun()) {
    return Error{"nothing has been played yet"};
  }
  Flight now = flight_;
  now.made_by = std::string(version) + " " + commit;
  now.isa = isa_name(best_isa());
  // Later records belong to the next block.
  std::copy_if(records_.begin(), records_.end(), std::back_inserter(now.records),
               [&](const FlightRecord& record) { return record.frame < now.end_frame; });
  return now;
}

}  // namespace ressort::session
