#include "app/session/scene_builder.h"

#include <algorithm>
#include <utility>

#include "app/session/compile_scene.h"
#include "app/session/load_progress.h"
#include "app/session/memory.h"
#include "app/session/timing.h"
#include "core/engine/renumbering.h"

namespace ressort::session {
namespace {

// Returns true if another engine can continue the state of this plan's. Modes leave out inaudible
// ones, so no other form can continue their state.
bool can_be_continued(const Plan& plan) {
  return std::ranges::none_of(plan.parts,
                              [](const Part& part) { return part.method == Method::modal; });
}

// Returns true if a compilation with more modes may find a cheaper plan.
bool may_gain(const Plan& plan) {
  return can_be_continued(plan) && std::ranges::any_of(plan.parts, &Part::may_gain);
}

// Returns true if forms that may be cheaper have not been measured.
bool is_untimed(const Plan& plan) {
  return std::ranges::any_of(plan.parts, &Part::is_untimed);
}

}  // namespace

// Inputs of the compilation of a draft.
struct SceneBuilder::Prepared {
  Scene scene;
  std::optional<Scene> as_read;  // while its files are watched
  std::vector<Setting> written;  // values in the texts that `Draft::kept` replaces
  CompileOptions options;
  FlightEngine made_of;
};

SceneBuilder::SceneBuilder(const SessionOptions& options, MessageHandler on_message,
                           WorkQueue& queue, CurrentScene& current, EngineSupply& engines,
                           SceneWatch& watch)
    : options_(options),
      on_message_(std::move(on_message)),
      queue_(queue),
      current_(current),
      engines_(engines),
      watch_(watch) {}

Result<std::shared_ptr<const Loaded>> SceneBuilder::load(const LoadRequest& request) {
  LoadProgress news(request.name, on_message_);
  bool was_stopped = false;
  const Progress progress([&](std::string_view stage) {
    news.at(stage);
    was_stopped = queue_.has_newer_load();
    return !was_stopped;
  });
  try {
    auto draft = read(request, progress);
    auto result = draft ? play(request, *std::move(draft), progress) : draft.error();
    return was_stopped && !result ? Error{queue_.reason_to_stop()} : result;
  } catch (const std::exception& error) {
    return Error{"'" + request.name + "' could not be loaded: " + describe(error)};
  }
}

SceneOptions SceneBuilder::scene_options(const LoadRequest& request,
                                         const Progress& progress) const {
  return {.bare = options_.compile.bare,
          .third = options_.third,
          .reach = request.reach,
          .keys = options_.keys,
          .progress = progress};
}

Result<Draft> SceneBuilder::read(const LoadRequest& request, const Progress& progress) const {
  const auto start = std::chrono::steady_clock::now();
  Reading reading = read_scene(request.name, scene_options(request, progress));
  auto files = std::make_shared<const std::vector<SceneFile>>(std::move(reading.files));
  auto scene = scene_of(std::move(reading));
  if (!scene) {
    return scene.error();
  }
  return Draft{.scene = *std::move(scene), .files = std::move(files), .start = start};
}

SceneBuilder::Prepared SceneBuilder::prepare(const LoadRequest& request, Draft draft,
                                             const Progress& progress) const {
  Prepared prepared{.scene = std::move(draft.scene), .options = options_.compile};
  Scene& scene = prepared.scene;
  if (watch_.is_on()) {
    prepared.as_read = scene;
  }
  prepared.written = keep_values(scene, draft.kept);
  scene.preset.gain *= options_.gain;
  CompileOptions& options = prepared.options;
  options.rate_hz = queue_.rate_hz();
  options.find_gain = !scene.has_preset;
  options.most_modes = quick_modes;
  options.force = request.force;
  options.progress = progress;
  options.most_bytes = free_memory_bytes();
  options.timings = timings_.time ? &recalled_ : nullptr;
  prepared.made_of = {.lets_ring = request.lets_ring,
                      .path = scene.path,
                      .files = std::move(draft.files),
                      .kept = std::move(draft.kept),
                      .rate_hz = options.rate_hz,
                      .most_modes = options.most_modes,
                      .find_gain = options.find_gain,
                      .force = options.force,
                      .gain = scene.preset.gain};
  return prepared;
}

Result<std::shared_ptr<const Loaded>> SceneBuilder::play(const LoadRequest& request, Draft draft,
                                                         const Progress& progress) {
  const auto start = draft.start;
  const bool continues_state = draft.continues_state;
  Prepared prepared = prepare(request, std::move(draft), progress);
  const Scene& scene = prepared.scene;
  CompileOptions& options = prepared.options;
  std::vector<std::string> warnings = scene.warnings;
  auto compiled = compile_scene(scene, options, warnings);
  if (!compiled) {
    return compiled.error();
  }
  if (!may_gain(compiled->plan)) {  // else improve() warns
    if (std::string warning = overload_warning(*compiled, options, timings_); !warning.empty()) {
      warnings.push_back(std::move(warning));
    }
  }
  const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - start;
  const bool is_improvable = may_gain(compiled->plan) || is_untimed(compiled->plan);
  FlightEngine& made_of = prepared.made_of;
  made_of.forms = forms_of(compiled->plan);
  made_of.has_new_numbers = continues_state && engines_.newest() != nullptr &&
                            can_renumber(engines_.newest()->machine(), compiled->engine->machine());
  if (!made_of.has_new_numbers) {
    engines_.begin_new_serial();
  }
  std::vector<double> values;
  for (ParameterInfo& info : compiled->instrument.parameters) {
    values.push_back(info.value);
    for (const Setting& written : prepared.written) {
      info.value = written.parameter == info.name ? written.value : info.value;
    }
  }
  const auto loaded =
      std::make_shared<const Loaded>(Loaded{.serial = engines_.serial(),
                                            .name = scene.name,
                                            .path = scene.path,
                                            .model_path = scene.model_path,
                                            .description = scene.preset.description,
                                            .preset = scene.preset,
                                            .preset_text = scene.preset_text,
                                            .instrument = std::move(compiled->instrument),
                                            .plan = std::move(compiled->plan),
                                            .load_ms = took.count(),
                                            .warnings = std::move(warnings)});
  engines_.prepare_audio_inputs(loaded->instrument.audio_inputs);
  current_.replace(loaded, std::move(values), made_of.files);
  queue_.set_built_rate(options.rate_hz);
  engines_.offer(std::move(compiled->engine), scene.network, made_of,
                 loaded->instrument.audio_inputs > 0);
  watch_.set_as_read(std::move(prepared.as_read));
  watch_.follow(*made_of.files);
  improvable_.reset();
  if (is_improvable) {
    options.find_gain = false;
    options.most_modes = patient_modes;
    options.progress = {};
    prepared.scene.preset.gain = loaded->instrument.gain;
    improvable_ = {std::move(prepared.scene.network), std::move(prepared.scene.preset), options,
                   std::move(made_of)};
  }
  return loaded;
}

void SceneBuilder::improve() {
  const Improvable source = *std::exchange(improvable_, std::nullopt);
  bool was_stopped = false;
  CompileOptions options = source.options;
  options.progress = Progress([&](std::string_view) {
    was_stopped = queue_.has_other_work();
    return !was_stopped;
  });
  options.most_bytes = free_memory_bytes();
  options.timings = timings_.time ? &timings_ : nullptr;
  auto compiled = compile_network(source.network, source.preset, options);
  wisdom_.save();
  if (!compiled) {
    if (was_stopped) {
      improvable_ = source;  // try again, unless another scene is loaded
    }
    return;
  }
  std::vector<std::string> forms = forms_of(compiled->plan);
  Plan playing = current_.loaded()->plan;
  if (forms == forms_of(playing)) {
    current_.set_plan(std::move(compiled->plan));
    return;
  }
  if (!can_be_continued(playing)) {
    playing.notes.emplace_back("another kernel is measured to be cheaper; the next load takes it");
    current_.set_plan(std::move(playing));
    return;
  }
  const std::string overload = overload_warning(*compiled, source.options, timings_);
  const auto broken = missed_budget(compiled->plan);
  current_.set_plan(std::move(compiled->plan));
  FlightEngine made_of = source.made_of;
  made_of.gain = source.preset.gain;
  made_of.find_gain = false;
  made_of.most_modes = source.options.most_modes;
  made_of.forms = std::move(forms);
  made_of.lets_ring = made_of.has_new_numbers = false;
  engines_.offer(std::move(compiled->engine), source.network, std::move(made_of),
                 current_.loaded()->instrument.audio_inputs > 0);
  if (!overload.empty()) {
    on_message_(overload);
  }
  if (broken) {
    on_message_(*broken);
  }
  measure_parts();
}

void SceneBuilder::measure_parts() {
  if (!timings_.time) {
    return;
  }
  const auto loaded = current_.loaded();
  Plan plan = loaded->plan;
  measure(plan, *engines_.newest(), options_.compile, loaded->instrument.voices, timings_);
  wisdom_.save();
  current_.set_plan(std::move(plan));
}

}  // namespace ressort::session
