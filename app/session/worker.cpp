#include "app/session/worker.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "app/session/files.h"
#include "app/session/load_progress.h"
#include "app/session/modes/tuned_files.h"
#include "app/text.h"
#include "core/model/language/expression.h"
#include "core/model/language/print.h"
#include "core/ranges.h"

namespace ressort::session {
namespace {

TimedEvent parameter_event(const Loaded& loaded, std::size_t index, double value) {
  return {.event = {.kind = EventKind::parameter,
                    .index = static_cast<std::uint16_t>(index),
                    .model = loaded.serial,
                    .value = value}};
}

std::string to_text(const std::vector<Setting>& settings) {
  return joined(settings, ", ", [](const Setting& setting) {
    return setting.parameter + " = " + print_number(setting.value);
  });
}

// Returns for example "controller 20, an encoder (offset),".
std::string words_for(const ControllerInput& input) {
  const bool is_nrpn = input.source == ControllerSource::nrpn;
  return (is_nrpn ? "NRPN " : "controller ") + std::to_string(input.number) +
         (input.has_14_bits ? " with 14 bits" : "") +
         (input.mode == ControllerMode::absolute
              ? ""
              : ", an encoder (" + std::string(name_of(input.mode)) + "),");
}

std::string with_lines(std::string text, const std::vector<std::string>& lines) {
  for (const std::string& line : lines) {
    text += "\n" + line;
  }
  return text;
}

}  // namespace

Worker::Worker(Process& process, const SessionOptions& options, MessageHandler on_message,
               WorkQueue& queue, CurrentScene& current, FlightRecorder& flights,
               EngineSupply& engines, SceneWatch& watch)
    : process_(process),
      options_(options),
      on_message_(std::move(on_message)),
      queue_(queue),
      current_(current),
      flights_(flights),
      engines_(engines),
      watch_(watch),
      builder_(options, on_message_, queue, current, engines, watch),
      thread_([this] { run(); }) {}

Worker::~Worker() {
  thread_.join();
}

void Worker::run() {
  while (auto work = queue_.next()) {
    try {
      read_reports();
      if (work->load) {
        load(*work->load);
      } else if (work->inquiry) {
        try {
          work->inquiry->work();
        } catch (const std::exception& error) {
          work->inquiry->refuse(Error{describe(error)});
        }
      } else if (work->has_new_rate) {
        rebuild_at_new_rate();
      } else if (watch_.has_changed()) {
        reload();
      } else if (builder_.can_improve()) {
        builder_.improve();
      }
    } catch (const std::exception& error) {
      // The playing scene continues.
      on_message_("error in the background: " + describe(error));
    }
  }
}

Progress Worker::interruptible() const {
  return Progress([this](std::string_view) { return !queue_.has_newer_load(); });
}

double Worker::model_rate_hz() const {
  return options_.compile.rescale ? queue_.built_rate_hz() : Network::reference_rate_hz;
}

// --- loads --------------------------------------------------------------------------------------

void Worker::load(const LoadJob& job) {
  LastChange change = current_.all_values();
  const auto request = job.request.target ? write_tuned(*job.request.target) : job.request;
  const auto result = request ? builder_.load(*request) : request.error();
  if (result) {
    loaded_ = *request;
    loaded_->lets_ring = false;  // not if it is compiled again
    current_.set_last_change(std::move(change));
  }
  if (job.answer) {
    job.answer(result);
  } else if (!result) {
    on_message_(result.error().message);
  }
  if (result) {
    builder_.measure_parts();
  }
}

void Worker::rebuild_at_new_rate() {
  const double rate_hz = queue_.rate_hz();
  if (!loaded_) {
    queue_.set_built_rate(rate_hz);
    return;
  }
  const auto result = builder_.load(*loaded_);
  if (result) {
    builder_.measure_parts();
  } else if (!queue_.has_newer_load()) {
    on_message_(result.error().message);
    queue_.set_built_rate(rate_hz);  // so that the compilation is not tried again and again
  }
}

// Programs are the presets in listed order, starting at bank 0.
void Worker::change_program(int number) {
  const std::vector<std::string> presets = known_presets();
  const std::string program = "program " + std::to_string(number % 128 + 1);
  const auto index = static_cast<std::size_t>(number);
  if (index < presets.size()) {
    load_preset(presets[index], program);
  } else if (unknown_programs_.insert(number).second) {
    on_message_("there is no " + program + " in bank " + std::to_string(number / 128) +
                "; there are " + counted(presets.size(), "preset", "presets"));
  }
}

// Loads a preset as a program change does: the old sound rings on.
void Worker::load_preset(const std::string& name, const std::string& reason) {
  const auto answer = [this, name, reason](const auto& result) {
    if (result) {
      on_message_(reason + ": " + name);
    } else if (result.error().message != replaced && result.error().message != ending) {
      on_message_(result.error().message);
    }
  };
  queue_.add(LoadJob{{.name = name, .reach = Reach::own_folders, .lets_ring = true}, answer});
}

// Does what a button of the mapping asks for: next, previous or load.
void Worker::press(const std::string& action) {
  if (action.empty()) {
    return;  // the mapping has just changed
  }
  if (action == "next" || action == "previous") {
    return load_preset(preset_beside(queue_.newest_load(), action == "next" ? 1 : -1), action);
  }
  const std::string name = action.substr(action.find(' ') + 1);
  const std::vector<std::string> presets = known_presets();
  double number = 0.0;
  if (!parse_number(name, number)) {
    load_preset(name, action);
  } else if (number >= 1.0 && number <= static_cast<double>(presets.size())) {
    load_preset(presets[static_cast<std::size_t>(number) - 1], action);
  } else {
    on_message_("'" + action + "': there are " + counted(presets.size(), "preset", "presets"));
  }
}

void Worker::read_reports() {
  engines_.collect();
  Report report;
  std::optional<int> program;  // only the last request counts
  while (process_.reports.pop(report)) {
    const auto loaded = current_.loaded();
    const bool is_current = report.model == loaded->serial;
    if (report.kind == Report::Kind::parameter && is_current) {
      const TimedEvent event = parameter_event(*loaded, report.index, report.value);
      current_.remember({&event, 1});
    } else if (report.kind == Report::Kind::controller && is_current) {
      current_.remember_turn(report.index, report.value);
    } else if (report.kind == Report::Kind::reset) {
      problems_.add_reset(is_current ? loaded->name : "the last model",
                          is_current && loaded->instrument.verdict == Verdict::stable);
    } else if (report.kind == Report::Kind::overload && is_current) {
      problems_.add_overload(report, loaded->plan.precision);
    } else if (report.kind == Report::Kind::program) {
      program = static_cast<int>(report.value);
    } else if (report.kind == Report::Kind::heard) {
      current_.hear(static_cast<int>(report.model), report.index,
                    static_cast<int>(std::lround(127.0 * std::clamp(report.value, 0.0, 1.0))));
    } else if (report.kind == Report::Kind::action) {
      press(current_.action(report.index));
    }
  }
  if (program) {
    change_program(*program);
  }
  const Meters now = process_.meters();
  if (const auto learned = current_.assign_turned_knob()) {
    const std::string& target = learned->setting.target;
    on_message_(
        words_for(learned->setting.input) + " now controls " + target + "; 'unlearn " + target +
        "' ends that" +
        (learned->failure ? "\nnot kept for the next start: " + learned->failure->message : ""));
  }
  if (const auto news = flights_.collect(now)) {
    on_message_(*news);
  }
  problems_.add_lost_events(now);
  problems_.report(on_message_);
}

// --- reloads ------------------------------------------------------------------------------------

void Worker::reload() {
  if (!loaded_) {
    return;
  }
  Reload news;
  const auto start = std::chrono::steady_clock::now();
  try {
    Reading reading = read_scene(loaded_->name, builder_.scene_options(*loaded_, interruptible()));
    watch_.follow(reading.files);
    if (reading.scene) {
      auto done = apply_edit(
          {.scene = *std::move(reading.scene),
           .files = std::make_shared<const std::vector<SceneFile>>(std::move(reading.files)),
           .start = start});
      news.is_done = static_cast<bool>(done);
      news.news = done ? *done : done.error().message;
    } else {
      news.is_done = false;
      news.news = joined(reading.findings, "\n", with_source);
    }
  } catch (const std::exception& error) {
    news.is_done = false;
    news.news = error.what();
  }
  if (queue_.has_newer_load()) {
    return;  // the load reports its own result
  }
  if (!news.is_done) {
    news.news += "\nthe scene that was loaded before keeps playing";
  }
  watch_.publish(news);
  on_message_(news.news);
}

// Applies an edited scene with as little change of the sound as possible: changed start values are
// sent as parameter changes, other changed numbers go into the sounding voices, and everything else
// is a load. Returns a message about the change, or the error.
Result<std::string> Worker::apply_edit(Draft draft) {
  const std::string name = draft.scene.name;
  const CurrentScene::Present now = current_.present();
  const auto& known = now.loaded->instrument.parameters;
  std::vector<Setting> changed;
  if (const std::optional<Scene>& before = watch_.as_read()) {
    const std::vector<Setting> starts = start_settings(*before);
    for (const Setting& start : start_settings(draft.scene)) {
      const auto was = std::ranges::find(starts, start.parameter, &Setting::parameter);
      if (was != starts.end() && was->value != start.value) {
        changed.push_back(start);
      } else if (was != starts.end()) {  // keep what a player has changed
        for (std::size_t i = 0; i < known.size(); ++i) {
          if (known[i].name == start.parameter && now.values[i] != known[i].value) {
            draft.kept.push_back({start.parameter, now.values[i]});
          }
        }
      }
    }
    if (differs_in_start_values_only(*before, draft.scene)) {
      if (changed.empty()) {
        return with_lines(name + ": reloaded; the sound is unchanged", draft.scene.warnings);
      }
      std::vector<TimedEvent> events;
      for (const Setting& setting : changed) {
        for (std::size_t i = 0; i < known.size(); ++i) {
          if (known[i].name == setting.parameter && known[i].audio_input == 0 &&
              known[i].minimum <= setting.value && setting.value <= known[i].maximum) {
            events.push_back(parameter_event(*now.loaded, i, setting.value));
          }
        }
      }
      if (events.size() == changed.size()) {
        send(events);
        std::string text = with_lines(name + ": " + to_text(changed), draft.scene.warnings);
        watch_.set_as_read(std::move(draft.scene));
        return text;
      }
    }
    draft.continues_state = has_same_parameters(before->network, draft.scene.network) &&
                            differs_in_numbers_only(before->preset, draft.scene.preset) &&
                            before->third == draft.scene.third &&
                            before->has_preset == draft.scene.has_preset;
  }
  LoadProgress news(name, on_message_);
  const Progress progress([&](std::string_view stage) {
    news.at(stage);
    return !queue_.has_newer_load();
  });
  const std::uint32_t serial = engines_.serial();
  const auto result = builder_.play(*loaded_, std::move(draft), progress);
  if (!result) {
    return result.error();
  }
  builder_.measure_parts();
  return with_lines(name + (serial == engines_.serial() ? ": new numbers" : ": loaded again") +
                        " in " + fixed((*result)->load_ms, 1) + " ms" +
                        (changed.empty() ? "" : "; " + to_text(changed)),
                    (*result)->warnings);
}

bool Worker::send(const std::vector<TimedEvent>& events) {
  const bool is_sent = process_.send(process_.from_session, events);
  if (is_sent) {
    current_.remember(events);
  }
  return is_sent;
}

// --- modes and timbre ---------------------------------------------------------------------------

Result<Scene> Worker::read_current(const CurrentScene::Present& now,
                                   const Progress& progress) const {
  if (now.loaded->serial == 0) {
    return Error{"nothing is loaded"};
  }
  auto scene = load_scene(now.loaded->path, builder_.scene_options({}, progress));
  if (scene && scene->network.parameters.size() != now.values.size()) {
    return Error{"the model's file was changed since it was loaded; load it again"};
  }
  return scene;
}

Result<KnownModes> Worker::find_modes(std::size_t count) {
  const CurrentScene::Present now = current_.present();
  const ModeOptions options{
      .rate_hz = queue_.rate_hz(), .count = count, .progress = interruptible()};
  const auto scene = read_current(now, options.progress);
  return scene ? known_modes(*scene, now.values, options) : scene.error();
}

Result<Shaped> Worker::shape(const std::vector<TimbreTarget>& targets) {
  constexpr int usual_key = 57;
  const CurrentScene::Present now = current_.present();
  const Progress progress = interruptible();
  const auto scene = read_current(now, progress);
  if (!scene) {
    return scene.error();
  }
  const Instrument& instrument = now.loaded->instrument;
  const Meters meters = process_.meters();
  const ShapeRequest request{
      .scene = *scene,
      .parameters = instrument.parameters,
      .values = now.values,
      .has_keys = scene->has_preset && instrument.mode.has_value(),
      .key = meters.notes == 0
                 ? usual_key
                 : meters.last_notes[(meters.notes - 1) % meters.last_notes.size()].key,
      .rate_hz = model_rate_hz(),
      .progress = progress};
  auto shaped = shape_timbre(request, targets);
  if (!shaped) {
    return shaped;
  }
  if (request.has_keys) {
    std::vector<Setting> values;
    for (std::size_t i = 0; i < now.values.size(); ++i) {
      if (instrument.parameters[i].audio_input == 0) {
        values.push_back({instrument.parameters[i].name, shaped->found.values[i]});
      }
    }
    const auto done = retune(std::move(values), progress);
    return done ? std::move(shaped) : Result<Shaped>(done.error());
  }
  std::vector<TimedEvent> events;
  for (std::size_t i = 0; i < now.values.size(); ++i) {
    if (shaped->found.values[i] != now.values[i]) {
      events.push_back(parameter_event(*now.loaded, i, shaped->found.values[i]));
    }
  }
  return send(events)
             ? std::move(shaped)
             : Result<Shaped>(Error{"the audio thread is busy and accepted no events; try again"});
}

Result<Done> Worker::retune(std::vector<Setting> values, const Progress& progress) {
  auto draft = builder_.read(*loaded_, progress);
  if (!draft) {
    return draft.error();
  }
  LastChange change = current_.all_values();
  draft->kept = std::move(values);
  draft->continues_state = differs_in_numbers_only(current_.loaded()->preset, draft->scene.preset);
  const auto result = builder_.play(*loaded_, *std::move(draft), progress);
  if (!result) {
    return result.error();
  }
  current_.set_last_change(std::move(change));
  builder_.measure_parts();
  return Done{};
}

Result<LoadRequest> Worker::write_tuned(const TuneTarget& target) {
  const CurrentScene::Present now = current_.present();
  const ModeOptions options{.rate_hz = model_rate_hz(), .progress = interruptible()};
  const auto scene = read_current(now, options.progress);
  if (!scene) {
    return scene.error();
  }
  const auto tuned = tune_mode(scene->network, now.values, target, options);
  if (!tuned) {
    return tuned.error();
  }
  const std::string model = print_network(tuned->network);
  const auto files = tuned_files(now.loaded->name, model);
  if (!files) {
    return files.error();
  }
  const auto preset = current_.preset_text(files->model, options_.gain);
  if (!preset) {
    return preset.error();
  }
  for (const auto& [path, text] :
       {std::pair(files->model, model), std::pair(files->preset, *preset)}) {
    if (auto written = write_text(path, text, Existing::replace); !written) {
      return written.error();
    }
  }
  return LoadRequest{.name = files->preset};
}

}  // namespace ressort::session
