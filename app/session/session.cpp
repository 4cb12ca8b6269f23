#include "app/session/session.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <future>
#include <new>
#include <utility>

#include "app/session/admit.h"
#include "app/session/load_news.h"
#include "app/session/memory.h"
#include "app/session/timing.h"
#include "app/text.h"
#include "core/laws/law.h"
#include "core/model/topology.h"

namespace ressort::session {
namespace {

constexpr double least_lateness_s = 0.05;  // to be told of: what is less is hardly heard

double to_db(double factor) {
  return 20.0 * std::log10(factor);
}

// Not from modes, which leave out what nobody hears: nothing can go on from them.
bool may_gain(const Plan& plan) {
  const auto any = [&](auto&& is_so) {
    return std::any_of(plan.parts.begin(), plan.parts.end(), is_so);
  };
  return any([](const Part& part) { return part.may_gain; }) &&
         !any([](const Part& part) { return part.method == Method::modal; });
}

const char* const ending = "the program is ending";
const char* const replaced = "replaced by a newer load";

}  // namespace

Session::Session(Process& process, const SessionOptions& options, Tell tell)
    : process_(process),
      options_(options),
      tell_(std::move(tell)),
      rate_hz_(options_.compile.rate_hz),
      built_rate_hz_(rate_hz_),
      current_(std::make_shared<Loaded>()),
      flight_({.rescale = options_.compile.rescale,
               .voices = options_.compile.voices,
               .share = options_.compile.share,
               .precision = options_.compile.precision,
               .method = options_.compile.method,
               .budget = options_.compile.budget,
               .third = options_.third,
               .keys = options_.keys}),
      worker_([this] { work(); }) {}

Session::~Session() {
  end();
  worker_.join();
}

void Session::end() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  wake_.notify_all();
}

void Session::load(std::string name, Answer answer, bool force, Reach reach) {
  {
    const std::lock_guard lock(mutex_);
    if (!stop_) {
      jobs_.push_back(
          {Wish{.name = std::move(name), .force = force, .reach = reach}, std::move(answer)});
      wake_.notify_all();
      return;
    }
  }
  if (answer) {
    answer(Error{ending});
  }
}

Result<std::shared_ptr<const Loaded>> Session::load_and_wait(const std::string& name, bool force) {
  std::promise<Result<std::shared_ptr<const Loaded>>> promise;
  load(
      name, [&](const auto& result) { promise.set_value(result); }, force);
  return promise.get_future().get();
}

bool Session::wait(std::chrono::duration<double> time) {
  std::unique_lock lock(mutex_);
  return !wake_.wait_for(lock, time, [this] { return stop_; });
}

void Session::set_rate(double rate_hz) {
  {
    const std::lock_guard lock(mutex_);
    rate_hz_ = rate_hz;
  }
  wake_.notify_all();
}

std::shared_ptr<const Loaded> Session::current() const {
  const std::lock_guard lock(mutex_);
  return current_;
}

Session::Present Session::present() const {
  const std::lock_guard lock(mutex_);
  return {current_, values_};
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

void Session::remember(std::span<const TimedEvent> events) {
  const std::lock_guard lock(mutex_);
  std::vector<std::string> names;
  for (const TimedEvent& timed : events) {
    const Event& event = timed.event;
    if (event.kind == EventKind::parameter && event.model == current_->serial) {
      names.push_back(current_->instrument.parameters[event.index].name);
    }
  }
  begin_change(names);
  for (const TimedEvent& timed : events) {
    const Event& event = timed.event;
    if (event.kind == EventKind::parameter && event.model == current_->serial) {
      values_[event.index] = event.value;
    }
  }
}

Status Session::status(Asker asker) {
  Status status;
  status.period_frames = process_.clock.read().period;
  const std::lock_guard lock(mutex_);
  static_cast<Meters&>(status) = process_.meters();
  if (!process_.meters_were_read.is_raised()) {  // else these are the ones that were read
    peaks_.add(status);
    process_.meters_were_read.raise();
  }
  peaks_.take(asker, status);
  status.model = current_->name;
  status.load_ms = current_->load_ms;
  status.max_voices = current_->instrument.voices;
  status.backend = backend_;
  status.cpu = runs_ ? status.load : -1.0;
  status.rate_hz = rate_hz_;
  status.peak_db = to_db(status.peak);
  status.limited_db = to_db(status.limited);
  return status;
}

void Session::set_backend(std::string description, bool runs) {
  const std::lock_guard lock(mutex_);
  backend_ = std::move(description);
  runs_ = runs;
}

void Session::on_engine(PictureOf picture_of) {
  const std::lock_guard lock(mutex_);
  picture_of_ = std::move(picture_of);
}

void Session::on_audio_inputs(std::function<void(int)> prepare) {
  const std::lock_guard lock(mutex_);
  prepare_inputs_ = std::move(prepare);
}

void Session::work() {
  using namespace std::chrono_literals;
  if (options_.keeps_flights) {
    process_.keeps_flight.raise();
  }
  if (options_.watch) {
    watch_.emplace();
  }
  while (true) {
    std::deque<Job> jobs;
    std::optional<Inquiry> inquiry;
    bool is_ending = false;
    bool wants_again = false;
    {
      std::unique_lock lock(mutex_);
      wake_.wait_for(lock, 20ms, [this] {
        return stop_ || !jobs_.empty() || !inquiries_.empty() || has_new_rate();
      });
      jobs.swap(jobs_);
      if (jobs.empty() && !inquiries_.empty()) {
        inquiry = std::move(inquiries_.front());
        inquiries_.pop_front();
      }
      is_ending = stop_;
      wants_again = has_new_rate();
    }
    while (jobs.size() > (is_ending ? 0 : 1)) {
      if (jobs.front().answer) {
        jobs.front().answer(Error{is_ending ? ending : replaced});
      }
      jobs.pop_front();
    }
    if (is_ending) {
      const std::lock_guard lock(mutex_);
      for (const Inquiry& one : inquiries_) {
        one.refuse(Error{ending});
      }
      return;
    }
    try {
      listen();
      if (!jobs.empty()) {
        do_load(jobs.front());
      } else if (inquiry) {
        answer(*inquiry);
      } else if (wants_again) {
        do_again();
      } else if (watch_ && (std::exchange(is_edited_, false) || watch_->has_changed())) {
        do_reload();
      } else if (source_) {
        improve();
      }
    } catch (const std::exception& error) {
      // What sounds goes on as it is.
      if (tell_) {
        tell_("what goes on behind the sound failed: " + describe(error));
      }
    }
  }
}

bool Session::has_new_rate() const {
  return rate_hz_ != built_rate_hz_;
}

bool Session::is_outdated(bool is_load) const {
  const std::lock_guard lock(mutex_);
  return stop_ || !jobs_.empty() || (!is_load && has_new_rate());
}

// The same model by other forms, of which some took too long to find while somebody waited; it goes
// on where the other is.
void Session::improve() {
  const Source source = *std::exchange(source_, std::nullopt);
  bool was_outdated = false;
  CompileOptions options = source.options;
  options.progress = Progress([&](std::string_view) {
    was_outdated = is_outdated(false);
    return !was_outdated;
  });
  options.most_bytes = free_memory_bytes();
  auto compiled = compile_network(source.network, source.preset, options);
  if (!compiled) {
    if (was_outdated) {
      source_ = source;  // another time, if it still sounds
    }
    return;
  }
  const std::string news = too_much(compiled->plan, compiled->instrument.voices,
                                    source.options.rate_hz, source.options.precision);
  const auto broken = broken_promise(compiled->plan);
  {
    const std::lock_guard lock(mutex_);
    auto loaded = std::make_shared<Loaded>(*current_);
    loaded->plan = std::move(compiled->plan);
    current_ = std::move(loaded);
  }
  FlightEngine made_of = source.made_of;
  made_of.gain = source.preset.gain;
  made_of.find_gain = false;
  made_of.most_modes = source.options.most_modes;
  made_of.lets_ring = made_of.has_new_numbers = false;
  offer(std::move(compiled->engine), source.network, std::move(made_of));
  if (!news.empty() && tell_) {
    tell_(news);
  }
  if (broken && tell_) {
    tell_(*broken);
  }
  time_parts();
}

void Session::offer(std::unique_ptr<Engine> engine, const Network& network, FlightEngine made_of) {
  PictureOf picture_of;
  {
    const std::lock_guard lock(mutex_);
    picture_of = picture_of_;
  }
  offered_ = engine.get();
  made_of.number = ++engines_;
  made_of.serial = serial_;
  auto next = std::make_unique<Sounding>();
  next->picture = picture_of ? picture_of(*engine, network) : 0;
  next->engine = std::move(engine);
  next->serial = serial_;
  next->lets_ring = made_of.lets_ring;
  next->has_new_numbers = made_of.has_new_numbers;
  next->number = made_of.number;
  if (options_.keeps_flights) {
    const std::lock_guard lock(mutex_);
    flight_.add(std::move(made_of), current_->instrument.audio_inputs > 0);
  }
  delete process_.slot.offer(next.release());
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
  std::optional<int> program;  // the last of those that were asked for meanwhile
  while (process_.reports.pop(report)) {
    const std::lock_guard lock(mutex_);
    const bool is_current = report.model == current_->serial;
    if (report.kind == Report::Kind::parameter && is_current) {
      begin_change({current_->instrument.parameters[report.index].name});
      values_[report.index] = report.value;
    } else if (report.kind == Report::Kind::reset) {
      resets_.add((is_current ? current_->name : std::string("the last model")) +
                  ": a voice became unstable and was faded out; lower its stiffness or "
                  "damping, or raise its mass");
    } else if (report.kind == Report::Kind::overload && is_current) {
      overloads_.add(describe_overload(report));
    } else if (report.kind == Report::Kind::program) {
      program = static_cast<int>(report.value);
    }
  }
  if (program) {
    change_program(*program);
  }
  const Meters now = process_.meters();
  hear_turns(now);
  look_out(now);
  if (now.late != late_reported_ && now.late_s > least_lateness_s) {
    lates_.add("an event came " + fixed(now.late_s, 3) + " s after its time",
               now.late - std::exchange(late_reported_, now.late));
  }
  if (now.dropped != dropped_reported_) {
    drops_.add("an event found no room and was dropped: more came than can be played",
               now.dropped - std::exchange(dropped_reported_, now.dropped));
  }
  for (RateLimit* const limit : {&resets_, &overloads_, &lates_, &drops_}) {
    if (const auto news = limit->take(); news && tell_) {
      tell_(*news);
    }
  }
}

// Programs are the presets in the order in which they are listed, from bank 0 on.
void Session::change_program(int number) {
  const std::vector<std::string> presets = known_presets();
  const auto index = static_cast<std::size_t>(number);
  if (index < presets.size()) {
    const auto answer = [this, name = presets[index], number](const auto& result) {
      if (result && tell_) {
        tell_("program " + std::to_string(number % 128 + 1) + ": " + name);
      } else if (!result && tell_ && result.error().message != replaced &&
                 result.error().message != ending) {
        tell_(result.error().message);
      }
    };
    const std::lock_guard lock(mutex_);
    jobs_.push_back(
        {{.name = presets[index], .reach = Reach::own_folders, .lets_ring = true}, answer});
  } else if (unknown_programs_.insert(number).second && tell_) {
    tell_("there is no program " + std::to_string(number % 128 + 1) + " in bank " +
          std::to_string(number / 128) + "; there are " +
          counted(presets.size(), "preset", "presets"));
  }
}

std::string Session::describe_overload(const Report& report) const {
  const std::string ways = ways_to_make_room(report.index, options_.compile.precision);
  return "the sound takes " + std::to_string(std::lround(100.0 * report.value)) +
         " % of the time there is" +
         (report.index > 0
              ? "; the quietest voices fade out, and " +
                    counted(report.index, "sounds", "sound at once") + " until there is time again"
              : "") +
         "; what makes room: a longer period, " + ways;
}

void Session::do_load(const Job& job) {
  LastChange change;
  {
    const std::lock_guard lock(mutex_);
    change.scene = current_->path;
    for (std::size_t i = 0; i < values_.size(); ++i) {
      change.values.emplace_back(current_->instrument.parameters[i].name, values_[i]);
    }
  }
  const auto wish = job.wish.target ? write_tuned(*job.wish.target) : job.wish;
  const auto result = wish ? build(*wish) : wish.error();
  if (result) {
    scene_ = *wish;
    scene_->lets_ring = false;  // not when it is compiled anew
    const std::lock_guard lock(mutex_);
    last_change_ = change.scene->empty() ? std::nullopt : std::optional(std::move(change));
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

// What sounds, at the backend's new rate.
void Session::do_again() {
  if (!scene_) {
    const std::lock_guard lock(mutex_);
    built_rate_hz_ = rate_hz_;
    return;
  }
  double rate_hz = 0.0;
  {
    const std::lock_guard lock(mutex_);
    rate_hz = rate_hz_;
  }
  const auto result = build(*scene_);
  if (result) {
    time_parts();
  } else if (!is_outdated(true)) {
    if (tell_) {
      tell_(result.error().message);
    }
    const std::lock_guard lock(mutex_);
    built_rate_hz_ = rate_hz;  // it is not tried again and again
  }
}

// Whatever happens, somebody is answered and what sounded goes on.
Result<std::shared_ptr<const Loaded>> Session::build(const Wish& wish) {
  LoadNews news(wish.name, tell_);
  bool was_outdated = false;
  const Progress progress([&](std::string_view stage) {
    news.at(stage);
    was_outdated = is_outdated(true);
    return !was_outdated;
  });
  try {
    auto result = build_now(wish, progress);
    if (was_outdated && !result) {
      const std::lock_guard lock(mutex_);
      return Error{stop_ ? ending : replaced};
    }
    return result;
  } catch (const std::exception& error) {
    return Error{"'" + wish.name + "' could not be loaded: " + describe(error)};
  }
}

SceneOptions Session::scene_options(const Wish& wish, const Progress& progress) const {
  return {.bare = options_.compile.bare,
          .third = options_.third,
          .reach = wish.reach,
          .keys = options_.keys,
          .progress = progress};
}

Result<std::shared_ptr<const Loaded>> Session::build_now(const Wish& wish,
                                                         const Progress& progress) {
  const auto start = std::chrono::steady_clock::now();
  Reading reading = read_scene(wish.name, scene_options(wish, progress));
  auto files = std::make_shared<const std::vector<SceneFile>>(std::move(reading.files));
  auto scene = scene_of(std::move(reading));
  return scene
             ? sound(wish, {.scene = *std::move(scene), .files = std::move(files), .start = start},
                     progress)
             : scene.error();
}

// Compiles what was read, and lets it sound.
Result<std::shared_ptr<const Loaded>> Session::sound(const Wish& wish, Draft draft,
                                                     const Progress& progress) {
  CompileOptions options = options_.compile;
  std::function<void(int)> prepare_inputs;
  {
    const std::lock_guard lock(mutex_);
    options.rate_hz = rate_hz_;
    prepare_inputs = prepare_inputs_;
  }
  Scene* const scene = &draft.scene;
  std::optional<Scene> as_read;
  if (watch_) {
    as_read = *scene;
  }
  const std::vector<Setting> written = keep_values(*scene, draft.kept);
  options.find_gain = !scene->has_preset;
  options.most_modes = quick_modes;
  options.force = wish.force;
  options.progress = progress;
  options.most_bytes = free_memory_bytes();
  scene->preset.gain *= options_.gain;
  FlightEngine made_of{.lets_ring = wish.lets_ring,
                       .path = scene->path,
                       .files = draft.files,
                       .kept = draft.kept,
                       .rate_hz = options.rate_hz,
                       .most_modes = options.most_modes,
                       .find_gain = options.find_gain,
                       .force = options.force,
                       .gain = scene->preset.gain};
  auto compiled = admit(*scene, options, scene->warnings);
  if (!compiled) {
    return compiled.error();
  }
  // What may gain by its modes is judged when they are found.
  if (!may_gain(compiled->plan)) {
    if (std::string warning = too_much(compiled->plan, compiled->instrument.voices, options.rate_hz,
                                       options.precision);
        !warning.empty()) {
      scene->warnings.push_back(std::move(warning));
    }
  }
  const std::chrono::duration<double, std::milli> took =
      std::chrono::steady_clock::now() - draft.start;
  made_of.has_new_numbers = draft.goes_on && offered_ != nullptr &&
                            can_renumber(offered_->machine(), compiled->engine->machine());
  auto loaded = std::make_shared<Loaded>();
  loaded->serial = made_of.has_new_numbers ? serial_ : ++serial_;
  loaded->name = scene->name;
  loaded->path = scene->path;
  loaded->model_path = scene->model_path;
  loaded->description = scene->preset.description;
  loaded->preset = scene->preset;
  loaded->preset_text = scene->preset_text;
  loaded->instrument = std::move(compiled->instrument);
  loaded->plan = std::move(compiled->plan);
  loaded->load_ms = took.count();
  loaded->warnings = std::move(scene->warnings);
  if (prepare_inputs) {
    prepare_inputs(loaded->instrument.audio_inputs);
  }
  std::vector<double> values;
  for (const ParameterInfo& info : loaded->instrument.parameters) {
    values.push_back(info.value);
  }
  for (ParameterInfo& info : loaded->instrument.parameters) {
    const auto as_written = std::find_if(
        written.begin(), written.end(), [&](const Setting& s) { return s.parameter == info.name; });
    info.value = as_written != written.end() ? as_written->value : info.value;
  }
  {
    const std::lock_guard lock(mutex_);
    const bool is_same = current_->path == loaded->path;
    current_ = loaded;
    files_ = draft.files;
    values_ = std::move(values);
    pupil_.reset();
    std::erase_if(learned_, [&](const LearnedRow& row) {
      return !is_same || control_of(row.target).model == 0;
    });
    for (const LearnedRow& row : learned_) {
      teach(row, true);
    }
    built_rate_hz_ = options.rate_hz;
  }
  offer(std::move(compiled->engine), scene->network, made_of);
  read_ = std::move(as_read);
  follow(*draft.files);
  source_.reset();
  if (may_gain(loaded->plan)) {
    options.find_gain = false;
    scene->preset.gain = loaded->instrument.gain;
    options.most_modes = patient_modes;
    options.progress = {};
    source_ = {std::move(scene->network), std::move(scene->preset), options, std::move(made_of)};
  }
  return std::shared_ptr<const Loaded>(std::move(loaded));
}

}  // namespace ressort::session
