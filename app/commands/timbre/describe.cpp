#include "app/commands/timbre/describe.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "app/commands/body/recording.h"
#include "app/commands/offline.h"
#include "app/commands/output.h"
#include "app/commands/progress_bar.h"
#include "app/commands/timbre/describe_text.h"
#include "app/commands/timbre/sweep.h"
#include "app/exit_code.h"
#include "app/session/compile_scene.h"
#include "app/session/files.h"
#include "app/session/load_progress.h"
#include "app/session/loader.h"
#include "app/session/modes/known_modes.h"
#include "app/session/sound_file.h"
#include "app/text.h"
#include "core/analysis/modes/modes.h"
#include "core/model/preset/fit.h"
#include "core/model/topology.h"

namespace ressort::commands {
namespace {

namespace fs = std::filesystem;

bool names_sound(const std::string& name) {
  const std::string ending = fs::path(name).extension().string();
  return std::ranges::any_of(sound_endings(),
                             [&](std::string_view known) { return same_but_case(known, ending); });
}

// Replaces the name of a temporary file in a message.
std::string renamed(std::string message, const std::string& path, const std::string& name) {
  const std::size_t at = message.find(path);
  return at == message.npos ? message : message.replace(at, path.size(), name);
}

// Analyses a sound file and, on request, its modes. Only warns if it has no modes.
Result<Description> describe_file(const std::string& path, const DescribeOptions& options,
                                  const DescriptionProgress& progress) {
  auto description = describe_sound(path, options.how, progress);
  if (!description || options.modes == 0) {
    return description;
  }
  const Progress should_continue([&](std::string_view) { return progress(1.0); });
  const auto found =
      identify_recordings(std::span(&path, 1), {.most_modes = options.modes}, should_continue);
  if (!found) {
    const std::string why = renamed(found.error().message, path, options.name);
    std::fprintf(stderr, "%s: no modes\n", why.c_str());
    return description;
  }
  for (const IdentifiedMode& mode : found->modes) {
    description->modes.push_back({mode.frequency_hz.value, mode.t60_s.value});
  }
  return description;
}

using Warn = std::function<void(const std::string&)>;

Result<Description> describe_note(const DescribeOptions& options, const Progress& loading,
                                  const DescriptionProgress& progress, const Warn& warn) {
  const auto folder = TemporaryFolder::make();
  if (!folder) {
    return folder.error();
  }
  const std::string path = folder->file("note.wav");
  auto rendered =
      render({.name = options.name,
              .output = path,
              .rate_hz = options.rate_hz,
              .seconds = options.seconds,
              .phrase = to_score({{0.0, 2.0 / 3.0 * options.seconds, options.key, 100}}),
              .parameters = options.settings,
              .format = SampleFormat::float64,
              .third = options.third,
              .loading = loading},
             [&](double share) { return progress(0.5 * share); });
  if (!rendered) {
    return rendered.error();
  }
  if (rendered->failure) {
    return *rendered->failure;
  }
  if (rendered->was_interrupted) {
    return Error{description_stopped};
  }
  for (const std::string& warning : rendered->warnings) {
    warn(warning);
  }
  if (rendered->peak == 0.0) {
    return Error{rendered->name + " is silent at key " + std::to_string(options.key) +
                 "; pass another --note"};
  }
  auto description =
      describe_file(path, options, [&](double share) { return progress(0.5 + 0.5 * share); });
  const std::string note = rendered->name + ", key " + std::to_string(options.key) + ", rendered";
  if (!description) {
    return Error{renamed(description.error().message, path, note)};
  }
  description->of = note;
  return description;
}

Result<Description> describe_model(const DescribeOptions& options,
                                   const DescriptionProgress& progress, const Warn& warn) {
  LoadProgress news(options.name, print_error);
  const Progress loading([&](std::string_view stage) {
    news.at(stage);
    return progress(0.0);
  });
  auto scene =
      load_scene(options.name, {.bare = true, .third = options.third, .progress = loading});
  if (!scene) {
    return scene.error();
  }
  if (scene->has_preset) {
    return describe_note(options, loading, progress, warn);
  }
  for (const std::string& warning : scene->warnings) {
    warn(warning);
  }
  std::vector<double> values = start_values(*scene);
  for (const Setting& setting : options.settings) {
    const int index = find_parameter(scene->network, setting.parameter);
    if (index < 0) {
      return Error{no_parameter(scene->network, setting.parameter)};
    }
    values[static_cast<std::size_t>(index)] = setting.value;
  }
  const auto at_model = [&](const Error& error) {
    return Error{to_string(finding_of(scene->model_path, "", error))};
  };
  const auto modes =
      find_modes(scene->network, values, {.rate_hz = options.rate_hz, .progress = loading});
  if (!modes) {
    return modes.error().message == stopped ? Error{description_stopped} : at_model(modes.error());
  }
  if (!modes->is_linear() || has_waveguide(scene->network)) {
    return Error{
        "'" + options.name +
        "' is not linear, so its sound depends on how it is played; render it with a score "
        "and describe that file"};
  }
  if (const auto warning = instability(*scene, values, options.rate_hz, loading)) {
    warn(to_string(*warning));
  }
  auto description = describe_modes(*modes, options.how);
  if (!description) {
    return at_model(description.error());
  }
  description->of = scene->name + ", from in1 to out1 by its " +
                    counted(modes->modes.size(), "mode", "modes") + ", in closed form";
  return description;
}

}  // namespace

Result<Description> description_of(const DescribeOptions& options,
                                   const DescriptionProgress& progress, const Warn& warn) {
  if (!names_sound(options.name)) {
    return describe_model(options, progress, warn);
  }
  return options.settings.empty()
             ? describe_file(options.name, options, progress)
             : Error{"'" + options.name +
                     "' is a sound file and has no parameters; --set needs a model"};
}

int describe(const DescribeOptions& options, const std::function<bool()>& should_continue) {
  for (const std::string& output : options.outputs) {
    const bool is_table = !options.swept.empty() && output.ends_with(".csv");
    if (!output.ends_with(".svg") && !is_table) {
      return reject("-o: expected a file that ends in .svg" +
                    std::string(options.swept.empty() ? "" : " or .csv") + ", found '" + output +
                    "'");
    }
    if (auto found = plot::check_gnuplot(); !is_table && !found) {
      return reject(output + ": " + found.error().message);
    }
    const std::string read[] = {options.name};
    if (auto spared = check_not_input(output, read); !spared) {
      return reject(spared.error().message);
    }
  }
  const DescribeOptions usual;
  if (names_sound(options.name) && (options.key != usual.key || options.seconds != usual.seconds ||
                                    options.rate_hz != usual.rate_hz || options.third)) {
    print_error("--note, --seconds, --rate and --motion have no effect on a sound file");
  }
  if (!options.swept.empty()) {
    return sweep(options, should_continue);
  }
  Result<Description> description = Error{};
  {
    ProgressBar bar(true);
    description = description_of(
        options,
        [&](double share) {
          bar.show(share, options.name);
          return should_continue();
        },
        print_error);
  }
  if (!should_continue()) {
    std::fprintf(stderr, "%s: interrupted\n", options.name.c_str());
    return exit_code::our_failure;
  }
  if (!description) {
    return reject(description.error().message);
  }
  for (const std::string& output : options.outputs) {
    const plot::Figure figure = description_figure(*description, options.how);
    if (const int code = put_figure(output, figure, options.force)) {
      return code;
    }
  }
  if (options.as_json) {
    print_json(*description, options.how);
  } else {
    std::printf("%s\n", to_text(*description, options.how).c_str());
  }
  return exit_code::done;
}

}  // namespace ressort::commands
