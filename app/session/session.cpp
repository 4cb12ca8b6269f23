#include "app/session/session.h"

#include <cmath>
#include <filesystem>
#include <future>
#include <utility>

#include "app/session/files.h"
#include "app/session/modes/tuned_files.h"
#include "core/ranges.h"

namespace ressort::session {
namespace {

double to_db(double factor) {
  return 20.0 * std::log10(factor);
}

FlightSetup flight_setup(const SessionOptions& options) {
  return {.rescale = options.compile.rescale,
          .voices = options.compile.voices,
          .share = options.compile.share,
          .precision = options.compile.precision,
          .method = options.compile.method,
          .budget = options.compile.budget,
          .third = options.third,
          .keys = options.keys};
}

// Only a load interrupts an inquiry.
template <class T>
Result<T> explained(Result<T> result) {
  return result || result.error().message != stopped
             ? std::move(result)
             : Result<T>(Error{"interrupted by a load; try again"});
}

}  // namespace

Session::Session(Process& process, const SessionOptions& options, MessageHandler on_message)
    : process_(process),
      options_(options),
      queue_(options.compile.rate_hz),
      current_(process, options.controllers, options.controllers_path),
      flights_(process, flight_setup(options), options.keeps_flights),
      engines_(process, flights_),
      watch_(options.watch),
      timbre_(process),
      worker_(
          process, options_, on_message ? std::move(on_message) : [](const std::string&) {}, queue_,
          current_, flights_, engines_, watch_) {}

Session::~Session() {
  end();
}

void Session::load(std::string name, Answer answer, bool force, Reach reach) {
  queue_.add(LoadJob{{.name = std::move(name), .force = force, .reach = reach}, std::move(answer)});
}

std::string Session::preset_beside(int step) const {
  return session::preset_beside(queue_.newest_load(), step);
}

Result<std::shared_ptr<const Loaded>> Session::load_and_wait(const std::string& name, bool force) {
  std::promise<Result<std::shared_ptr<const Loaded>>> promise;
  load(
      name, [&](const auto& result) { promise.set_value(result); }, force);
  return promise.get_future().get();
}

void Session::tune(TuneTarget target, Answer answer) {
  queue_.add(LoadJob{{.name = current()->name, .target = std::move(target)}, std::move(answer)});
}

void Session::find_modes(std::size_t count, ModesAnswer answer) {
  queue_.add(Inquiry{[this, count, answer] { answer(explained(worker_.find_modes(count))); },
                     [answer](const Error& error) { answer(error); }});
}

void Session::shape(std::vector<TimbreTarget> targets, ShapeAnswer answer) {
  queue_.add(Inquiry{
      [this, targets = std::move(targets), answer] { answer(explained(worker_.shape(targets))); },
      [answer](const Error& error) { answer(error); }});
}

Status Session::status(MeterReader asker) {
  Status status;
  status.period_frames = process_.clock.read().period;
  const auto loaded = current();
  const std::lock_guard lock(mutex_);
  static_cast<Meters&>(status) = process_.meters();
  if (!process_.meters_were_read.is_raised()) {  // else these meters were read already
    peaks_.add(status);
    process_.meters_were_read.raise();
  }
  peaks_.take(asker, status);
  status.model = loaded->name;
  status.load_ms = loaded->load_ms;
  status.max_voices = loaded->instrument.voices;
  status.backend = backend_;
  status.cpu = backend_runs_ ? status.load : -1.0;
  status.rate_hz = queue_.rate_hz();
  status.peak_db = to_db(status.peak);
  status.limited_db = to_db(status.limited);
  return status;
}

void Session::set_backend(std::string description, bool runs) {
  const std::lock_guard lock(mutex_);
  backend_ = std::move(description);
  backend_runs_ = runs;
}

std::vector<std::string> Session::tuning() const {
  const std::lock_guard lock(mutex_);
  return tuning_;
}

void Session::set_tuning(std::vector<std::string> paths) {
  const std::lock_guard lock(mutex_);
  tuning_ = std::move(paths);
}

Result<std::string> Session::save(const std::string& name, Existing existing) {
  const auto path = path_to_save(name);
  if (!path) {
    return path.error();
  }
  if (const std::string there = preset_path(name); existing == Existing::refuse && !there.empty()) {
    const std::string forced = "; type 'save " + name + " --force' at the console to ";
    return Error{there == *path ? "'" + name + "' exists already" + forced + "overwrite it"
                                : "'" + name + "' is a preset of the program" + forced +
                                      "save a preset of yours that replaces it"};
  }
  std::string model = current()->model_path;
  if (is_tuned(model)) {  // the cache may be deleted
    const auto kept = keep_tuned(model, name, existing);
    if (!kept) {
      return kept.error();
    }
    model = *kept;
  }
  auto through = mapped(current()->preset.bodies,
                        [](const BodyModel& body) { return model_name_elsewhere(body.file); });
  const auto text =
      current_.preset_text(model_name_elsewhere(model), options_.gain, std::move(through));
  if (!text) {
    return text.error();
  }
  const auto written = write_text(*path, *text, existing);
  return written ? Result<std::string>(*path) : written.error();
}

Result<std::string> Session::save_to(const std::string& folder) {
  namespace fs = std::filesystem;
  const auto now = current();
  const auto files = current_.files();
  if (files == nullptr) {
    return Error{"nothing is loaded that could be saved"};
  }
  const std::string name = now->name + ".toml";
  const fs::path from = fs::path(now->path).parent_path();
  // A file below the preset's folder keeps its relative path; all others go beside the preset.
  const auto place_of = [&](const std::string& path) {
    const fs::path place = fs::path(path).lexically_relative(from);
    const bool is_below = !place.empty() && *place.begin() != ".." && path != now->model_path;
    return is_below ? place : fs::path(path).filename();
  };
  auto through = mapped(now->preset.bodies,
                        [&](const BodyModel& body) { return place_of(body.file).string(); });
  const auto text =
      current_.preset_text(place_of(now->model_path).string(), options_.gain, std::move(through));
  if (!text) {
    return text.error();
  }
  for (const SceneFile& file : *files) {
    const bool is_preset = file.path == now->path && file.path.ends_with(".toml");
    if (!file.is_there || is_preset) {
      continue;
    }
    const fs::path place = place_of(file.path);
    std::error_code error;
    fs::create_directories((folder / place).parent_path(), error);
    if (auto written = write_text((folder / place).string(), file.text, Existing::replace);
        !written) {
      return written.error();
    }
  }
  const auto written = write_text((fs::path(folder) / name).string(), *text, Existing::replace);
  return written ? Result<std::string>(name) : written.error();
}

}  // namespace ressort::session
