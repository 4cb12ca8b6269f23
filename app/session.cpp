#include "app/session.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <future>

#include "app/admit.h"
#include "app/timing.h"
#include "core/model/topology.h"

namespace ressort {
namespace {

double to_db(double factor) {
  return 20.0 * std::log10(factor);
}

// Modes leave out what nobody hears, so that nothing can go on from them.
bool can_be_relieved(const Plan& plan) {
  return std::none_of(plan.parts.begin(), plan.parts.end(),
                      [](const Part& part) { return part.method == Method::modal; });
}

bool may_gain(const Plan& plan) {
  return std::any_of(plan.parts.begin(), plan.parts.end(),
                     [](const Part& part) { return part.may_gain; }) &&
         can_be_relieved(plan);
}

bool is_straight(const Network& network) {
  return std::all_of(network.links.begin(), network.links.end(),
                     [](const Link& link) { return link.kind == LinkKind::spring; });
}

std::string_view kind_of(const Link& link) {
  switch (link.kind) {
    case LinkKind::spring:
    case LinkKind::quadratic_spring:
    case LinkKind::cubic_spring:
    case LinkKind::clipped_spring:
      return "spring";
    case LinkKind::pluck:
      return "pluck";
    case LinkKind::bow:
    case LinkKind::smooth_bow:
      return "bow";
    case LinkKind::contact:
    case LinkKind::clipped_contact:
      return "contact";
  }
  return "link";
}

}  // namespace

Session::Session(Process& process, const SessionOptions& options, Tell tell)
    : process_(process),
      options_(options),
      tell_(std::move(tell)),
      rate_hz_(options_.compile.rate_hz),
      current_(std::make_shared<Loaded>()),
      worker_([this] { work(); }) {}

Session::~Session() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  wake_.notify_all();
  worker_.join();
  for (const Job& job : jobs_) {
    if (job.answer) {
      job.answer(Error{"the program is ending"});
    }
  }
}

void Session::load(std::string name, Answer answer, bool force) {
  {
    const std::lock_guard lock(mutex_);
    jobs_.push_back({std::move(name), std::move(answer), force});
  }
  wake_.notify_all();
}

Result<std::shared_ptr<const Loaded>> Session::load_and_wait(const std::string& name, bool force) {
  std::promise<Result<std::shared_ptr<const Loaded>>> promise;
  load(
      name, [&](const auto& result) { promise.set_value(result); }, force);
  return promise.get_future().get();
}

void Session::set_rate(double rate_hz) {
  {
    const std::lock_guard lock(mutex_);
    if (rate_hz_ == rate_hz) {
      return;
    }
    rate_hz_ = rate_hz;
    jobs_.push_back({"", {}});
  }
  wake_.notify_all();
}

std::shared_ptr<const Loaded> Session::current() const {
  const std::lock_guard lock(mutex_);
  return current_;
}

std::optional<double> Session::parameter(const std::string& name) const {
  const std::lock_guard lock(mutex_);
  const auto& parameters = current_->instrument.parameters;
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    if (parameters[i].name == name) {
      return values_[i];
    }
  }
  return std::nullopt;
}

Result<std::vector<Event>> Session::events(const Call& call) const {
  const std::lock_guard lock(mutex_);
  return to_events(call, current_->instrument, current_->serial);
}

void Session::remember(std::span<const TimedEvent> events) {
  const std::lock_guard lock(mutex_);
  for (const TimedEvent& timed : events) {
    const Event& event = timed.event;
    if (event.kind == EventKind::parameter && event.model == current_->serial) {
      values_[event.index] = event.value;
    }
  }
}

Status Session::status() {
  const Meters& meters = process_.meters;
  const ClockReading clock = process_.clock.read();
  Status status;
  {
    const std::lock_guard lock(mutex_);
    status.model = current_->name;
    status.load_ms = current_->load_ms;
    status.max_voices = current_->instrument.voices;
    status.backend = backend_;
    status.cpu = cpu_ ? cpu_() : -1.0;
    status.rate_hz = rate_hz_;
  }
  status.period_frames = clock.period;
  status.voices = meters.voices.get();
  status.peak_db = to_db(meters.peak.get());
  status.limited_db = to_db(meters.limited.get());
  status.xruns = meters.xruns.get();
  status.resets = meters.resets.get();
  status.stolen = meters.stolen.get();
  status.beyond = meters.beyond.get();
  status.saved = meters.saved.get();
  status.modes = meters.modes.get();
  status.modes_awake = meters.modes_awake.get();
  status.energy = meters.energy.get();
  status.loss = meters.loss.get();
  status.is_driven = meters.is_driven.get();
  status.is_whole = meters.is_whole.get();
  status.dropped = meters.dropped.get();
  status.late = meters.late.get();
  status.malformed = meters.malformed.get();
  status.swaps = meters.swaps.get();
  process_.meters.read.raise();
  return status;
}

void Session::set_backend(std::string description, std::function<double()> cpu) {
  const std::lock_guard lock(mutex_);
  backend_ = std::move(description);
  cpu_ = std::move(cpu);
}

void Session::on_audio_inputs(std::function<void(int)> prepare) {
  const std::lock_guard lock(mutex_);
  prepare_inputs_ = std::move(prepare);
}

void Session::work() {
  using namespace std::chrono_literals;
  while (true) {
    Job job;
    bool has_job = false;
    {
      std::unique_lock lock(mutex_);
      wake_.wait_for(lock, 20ms, [this] { return stop_ || !jobs_.empty(); });
      if (stop_) {
        return;
      }
      if (!jobs_.empty()) {
        job = std::move(jobs_.front());
        jobs_.pop_front();
        has_job = true;
      }
    }
    listen();
    if (has_job) {
      do_load(job);
    } else if (source_ && source_->may_gain) {
      improve();
    }
  }
}

// The same model by other forms, of which some took too long to find while somebody waited; it goes
// on where the other is.
void Session::improve() {
  source_->may_gain = false;
  auto compiled = compile(source_->network, source_->preset, source_->options);
  if (!compiled) {
    return;
  }
  {
    const std::lock_guard lock(mutex_);
    auto loaded = std::make_shared<Loaded>(*current_);
    loaded->plan = std::move(compiled->plan);
    current_ = std::move(loaded);
  }
  offer(std::move(compiled->engine));
  time_parts();
}

void Session::offer(std::unique_ptr<Engine> engine) {
  offered_ = engine.get();
  delete process_.slot.offer(new Sounding{std::move(engine), serial_});
}

// Only the worker destroys engines, and not before another one has been offered.
void Session::time_parts() {
  auto timed = std::make_shared<Loaded>(*current());
  measure(timed->plan, *offered_, options_.compile, timed->instrument.voices);
  const std::lock_guard lock(mutex_);
  current_ = std::move(timed);
}

// What the audio thread has sent: engines to destroy, and news.
void Session::listen() {
  delete process_.slot.collect();
  Report report;
  while (process_.reports.pop(report)) {
    std::string news;
    {
      const std::lock_guard lock(mutex_);
      const bool is_current = report.model == current_->serial;
      if (report.kind == Report::Kind::parameter && is_current) {
        values_[report.index] = report.value;
      } else if (report.kind == Report::Kind::reset && may_tell_reset()) {
        news = (is_current ? current_->name : std::string("the last model")) +
               ": a voice became unstable and was faded out; lower its stiffness or "
               "damping, or raise its mass";
      } else if (report.kind == Report::Kind::created && is_current) {
        news = calm(static_cast<std::uint32_t>(report.value));
      } else if (report.kind == Report::Kind::late && report.value > 0.05) {
        news = "an event came " + std::to_string(report.value) + " s after its time";
      }
    }
    if (!news.empty() && tell_) {
      tell_(news);
    }
  }
}

// An unstable voice may be lost with every note; once in a while is enough to hear of it.
bool Session::may_tell_reset() {
  const auto now = std::chrono::steady_clock::now();
  if (now < next_reset_news_) {
    return false;
  }
  next_reset_news_ = now + std::chrono::seconds(5);
  return true;
}

std::string Session::calm(std::uint32_t link) {
  if (!source_) {
    return {};
  }
  auto& passive = source_->options.passive_links;
  if (std::find(passive.begin(), passive.end(), link) != passive.end()) {
    return {};
  }
  passive.push_back(link);
  source_->may_gain = can_be_relieved(current_->plan);
  const Network whole =
      source_->network.macros.empty() ? source_->network : expand_macros(source_->network);
  const Link& creator = whole.links[link];
  return "the " + std::string(kind_of(creator)) + " '" + creator.name.text() + "' (" +
         std::filesystem::path(current_->model_path).filename().string() + ":" +
         std::to_string(creator.place.line) + ") created energy" +
         (source_->may_gain ? ": computed passively from now on"
                            : "; play it with --budget passive=always");
}

void Session::do_load(const Job& job) {
  const bool again = job.name.empty();
  if (again && scene_name_.empty()) {
    return;
  }
  const auto result = build(again ? scene_name_ : job.name, again ? is_forced_ : job.force);
  if (result && !again) {
    scene_name_ = job.name;
    is_forced_ = job.force;
  }
  if (job.answer) {
    job.answer(result);
  } else if (!result && tell_) {
    tell_(result.error().message);
  }
  if (result) {
    time_parts();
  }
}

Result<std::shared_ptr<const Loaded>> Session::build(const std::string& name, bool force) {
  const auto start = std::chrono::steady_clock::now();
  auto scene = load_scene(name, {.bare = options_.compile.bare, .third = options_.third});
  if (!scene) {
    return scene.error();
  }
  CompileOptions options = options_.compile;
  std::function<void(int)> prepare_inputs;
  {
    const std::lock_guard lock(mutex_);
    options.rate_hz = rate_hz_;
    prepare_inputs = prepare_inputs_;
  }
  options.find_gain = !scene->has_preset;
  options.most_modes = quick_modes;
  options.force = force;
  scene->preset.gain *= options_.gain;
  auto compiled = admit(*scene, options, scene->warnings);
  if (!compiled) {
    return compiled.error();
  }
  const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - start;
  auto loaded = std::make_shared<Loaded>();
  loaded->serial = ++serial_;
  loaded->name = scene->name;
  loaded->path = scene->path;
  loaded->model_path = scene->model_path;
  loaded->description = scene->preset.description;
  loaded->instrument = std::move(compiled->instrument);
  loaded->plan = std::move(compiled->plan);
  loaded->load_ms = took.count();
  loaded->warnings = std::move(scene->warnings);
  if (prepare_inputs) {
    prepare_inputs(loaded->instrument.audio_inputs);
  }
  {
    const std::lock_guard lock(mutex_);
    current_ = loaded;
    values_.clear();
    for (const ParameterInfo& info : loaded->instrument.parameters) {
      values_.push_back(info.value);
    }
  }
  offer(std::move(compiled->engine));
  source_.reset();
  if (may_gain(loaded->plan) || !is_straight(scene->network)) {
    options.find_gain = false;
    scene->preset.gain = loaded->instrument.gain;
    options.most_modes = patient_modes;
    source_ = {std::move(scene->network), std::move(scene->preset), options,
               may_gain(loaded->plan)};
  }
  return std::shared_ptr<const Loaded>(std::move(loaded));
}

}  // namespace ressort
