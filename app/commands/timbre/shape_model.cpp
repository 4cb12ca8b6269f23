#include "app/commands/timbre/shape_model.h"
#include "app/commands/output.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "app/commands/body/recording.h"
#include "app/commands/progress_bar.h"
#include "app/commands/timbre/description.h"
#include "app/exit_code.h"
#include "app/session/compile_scene.h"
#include "app/session/current_scene.h"
#include "app/session/files.h"
#include "app/session/load_progress.h"
#include "app/session/loader.h"
#include "app/session/memory.h"
#include "app/session/modes/known_modes.h"
#include "app/session/new_file.h"
#include "app/session/timbre/shape.h"
#include "core/model/preset/edit.h"
#include "core/ranges.h"

namespace ressort::commands {
namespace {

using json = nlohmann::ordered_json;

constexpr int usual_key = 57;
constexpr double near_f0 = 0.03;  // tolerance of the mode at the pitch

// Targets that a sound file sets.
struct SoundTargets {
  std::vector<TimbreTarget> targets;
  std::optional<double> f0_hz;
  double rate_hz = 0.0;
};

// Returns the figures of the loudest frame. A model is described by the first frame after a strike.
Result<SoundTargets> targets_like(const std::string& path, const Progress& progress,
                                  const std::function<bool()>& should_continue) {
  const auto sound = describe_sound(path, {}, [&](double) { return should_continue(); });
  if (!sound) {
    return sound.error();
  }
  SoundTargets like{.f0_hz = sound->f0_hz, .rate_hz = sound->rate_hz};
  const FigureValues& values = sound->frames[sound->loudest].values;
  for (const TargetFigureRow& row : target_figure_rows()) {
    const std::size_t number = figure_number(row.name);
    if (number < values.size() && values[number]) {
      like.targets.push_back({row.figure, *values[number]});
    }
  }
  if (sound->temporal) {
    like.targets.push_back(
        {TargetFigure::attack, 1e3 * std::pow(10.0, sound->temporal->log_attack_time)});
  }
  const auto found = identify_recordings(std::span(&path, 1), {.most_modes = 40}, progress);
  if (!found) {
    std::fprintf(stderr, "%s: no modes, so T60 is not a target\n", found.error().message.c_str());
    return like;
  }
  const IdentifiedMode* pitch = nullptr;
  const auto level = [](const IdentifiedMode& mode) {
    double sum = 0.0;
    for (const Measured& amplitude : mode.amplitude) {
      sum += amplitude.value * amplitude.value;
    }
    return sum;
  };
  const auto is_pitch = [&](const IdentifiedMode& mode) {
    return like.f0_hz && std::fabs(mode.frequency_hz.value / *like.f0_hz - 1.0) < near_f0;
  };
  for (const IdentifiedMode& mode : found->modes) {
    if (mode.t60_s.value > 0.0 && std::isfinite(mode.t60_s.value) &&
        (pitch == nullptr ||
         std::pair(is_pitch(mode), level(mode)) > std::pair(is_pitch(*pitch), level(*pitch)))) {
      pitch = &mode;
    }
  }
  if (pitch != nullptr) {
    like.targets.push_back({TargetFigure::t60, pitch->t60_s.value});
    like.f0_hz = is_pitch(*pitch) ? pitch->frequency_hz.value : like.f0_hz;
  }
  return like;
}

json figure_json(std::optional<double> value) {
  return value && std::isfinite(*value) ? json(*value) : json();
}

json to_json(const Shaped& shaped, const std::vector<double>& before, double rate_hz,
             const std::string& output) {
  json figures = json::object();
  for (const TargetFigureRow& row : target_figure_rows()) {
    const auto index = static_cast<std::size_t>(row.figure);
    json& figure = figures[std::string(row.name)];
    figure = {{"before", figure_json(shaped.found.before[index])},
              {"asked", json()},
              {"reached", figure_json(shaped.found.reached[index])},
              {"off_jnd", json()}};
    for (std::size_t t = 0; t < shaped.targets.size(); ++t) {
      if (shaped.targets[t].figure == row.figure) {
        figure["asked"] = shaped.targets[t].value;
        figure["off_jnd"] = shaped.found.noticed[t];
      }
    }
  }
  json parameters = json::object();
  for (std::size_t i = 0; i < shaped.names.size(); ++i) {
    parameters[shaped.names[i]] = {{"before", before[i]}, {"value", shaped.found.values[i]}};
  }
  json held = json::object();
  for (const FoundTimbre::Held& bound : shaped.found.held) {
    held[shaped.names[bound.index]] = bound.is_highest ? "highest" : "lowest";
  }
  return {{"of", shaped.of},
          {"rate_hz", rate_hz},
          {"figures", figures},
          {"parameters", parameters},
          {"at_bounds", held},
          {"missed", missed(shaped)},
          {"output", output.empty() ? json() : json(output)}};
}

Result<std::string> preset_of(const Scene& scene, const Instrument& instrument,
                              const std::vector<double>& values) {
  PresetChanges changes{
      .model = model_name_elsewhere(scene.model_path),
      .gain = instrument.gain,
      .parameters = changed_settings(instrument.parameters, scene.preset, values)};
  Preset made_up = scene.preset;
  made_up.model = changes.model;
  made_up.voices = instrument.voices;
  return edit_preset(scene.preset_text.empty() ? print_preset(made_up) : scene.preset_text,
                     changes);
}

// Returns the key with the nearest pitch.
int key_near(double f0_hz, const Preset& preset) {
  const double key = 69.0 + 12.0 * std::log2(f0_hz / preset.a4_hz) - preset.transpose;
  return static_cast<int>(std::lround(std::clamp(key, 0.0, 127.0)));
}

}  // namespace

int shape_model(const ShapeOptions& options, const std::function<bool()>& should_continue) {
  const auto refuse = [&](const std::string& message) {
    const bool was_stopped = !should_continue();
    std::fprintf(stderr, "%s\n",
                 was_stopped ? (options.name + ": interrupted").c_str() : message.c_str());
    return was_stopped ? exit_code::our_failure : exit_code::wrong_use;
  };
  if (options.targets.empty() && options.like.empty()) {
    return refuse("no target; pass a figure, such as --centroid 1800, or --like FILE.wav");
  }
  if (!options.output.empty() && !options.output.ends_with(".toml")) {
    return refuse("-o: expected a file that ends in .toml, found '" + options.output + "'");
  }
  LoadProgress news(options.name, print_error);
  const Progress progress([&](std::string_view stage) {
    news.at(stage);
    return should_continue();
  });
  auto scene = load_scene(options.name, {.third = options.third, .progress = progress});
  if (!scene) {
    return refuse(scene.error().message);
  }
  const std::string read[] = {scene->path, scene->model_path, options.like};
  if (auto spared = check_not_input(options.output, read); !spared) {
    return refuse(spared.error().message);
  }
  std::optional<NewFile> output;  // opened before the search, which may be slow
  if (!options.output.empty()) {
    auto file = NewFile::open(options.output, options.force ? Existing::replace : Existing::refuse);
    if (!file) {
      return refuse(file.error().message);
    }
    output.emplace(*std::move(file));
  }
  double rate_hz = options.rate_hz.value_or(Network::reference_rate_hz);
  SoundTargets like;
  if (!options.like.empty()) {
    auto found = targets_like(options.like, progress, should_continue);
    if (!found) {
      return refuse(found.error().message);
    }
    like = *std::move(found);
    rate_hz = options.rate_hz.value_or(like.rate_hz);
  }
  std::vector<std::string> warnings = scene->warnings;
  const auto compiled = compile_scene(*scene,
                                      {.rate_hz = rate_hz,
                                       .find_gain = !scene->has_preset,
                                       .progress = progress,
                                       .most_bytes = free_memory_bytes()},
                                      warnings);
  if (!compiled) {
    return refuse(compiled.error().message);
  }
  for (const std::string& warning : warnings) {
    print_error(warning);
  }
  const Instrument& instrument = compiled->instrument;
  const bool has_keys = scene->has_preset && instrument.mode.has_value();
  std::vector<TimbreTarget> targets = options.targets;
  const auto is_asked = [&](TargetFigure figure) {
    return std::ranges::any_of(targets,
                               [&](const TimbreTarget& target) { return target.figure == figure; });
  };
  for (const TimbreTarget& target : like.targets) {
    if (!is_asked(target.figure)) {
      targets.push_back(target);
    }
  }
  if (like.f0_hz && !has_keys && !is_asked(TargetFigure::f0)) {
    targets.push_back({TargetFigure::f0, *like.f0_hz});
  }
  const auto before = mapped(instrument.parameters, &ParameterInfo::value);
  std::optional<ProgressBar> bar(true);
  const auto shaped = shape_timbre(
      {.scene = *scene,
       .parameters = instrument.parameters,
       .values = before,
       .has_keys = has_keys,
       .key = options.key.value_or(like.f0_hz ? key_near(*like.f0_hz, scene->preset) : usual_key),
       .rate_hz = rate_hz,
       .progress = Progress([&](std::string_view) { return should_continue(); }),
       .on_progress =
           [&](double share) { bar->show(share, "searching the timbre of " + scene->name); }},
      targets);
  bar.reset();
  if (!shaped) {
    return refuse(shaped.error().message);
  }
  if (output) {
    const auto text = preset_of(*scene, instrument, shaped->found.values);
    if (!text) {
      return refuse(text.error().message);
    }
    auto written = output->write(*text);
    written = written ? output->keep() : written;
    if (!written) {
      print_error(written.error().message);
      return exit_code::our_failure;
    }
  }
  if (options.as_json) {
    std::printf("%s\n", to_json(*shaped, before, rate_hz, options.output)
                            .dump(2, ' ', false, json::error_handler_t::replace)
                            .c_str());
    return exit_code::done;
  }
  std::printf("%s\n", to_text(*shaped).c_str());
  for (const ShapedParameter& one : changed(*shaped, before)) {
    std::printf("%s = %.6g\n", one.name.c_str(), one.value);
  }
  if (!options.output.empty()) {
    std::printf("%s: play it with 'ressort play %s'\n", options.output.c_str(),
                options.output.c_str());
  }
  return exit_code::done;
}

}  // namespace ressort::commands
