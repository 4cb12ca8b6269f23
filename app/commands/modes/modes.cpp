#include "app/commands/modes/modes.h"

#include <cstdio>

#include "app/commands/modes/shapes_svg.h"
#include "app/exit_code.h"
#include "app/session/admit.h"
#include "app/session/files.h"
#include "app/session/load_news.h"
#include "app/session/loader.h"
#include "app/session/modes/known_modes.h"
#include "app/text.h"
#include "core/analysis/modes/tune.h"
#include "core/model/language/print.h"
#include "core/model/topology.h"

namespace ressort::commands {
namespace {

int refuse(const std::string& message) {
  std::fprintf(stderr, "%s\n", message.c_str());
  return exit_code::wrong_use;
}

// The scene with dampers and springs as they were asked for.
Result<Done> tune(Scene& scene, const std::vector<double>& parameters, const ModesOptions& options,
                  const ModeOptions& search) {
  if (!options.decay.empty()) {
    const auto law = decay_law(options.decay);
    if (!law) {
      return law.error();
    }
    std::fprintf(stderr, "every mode decays by %.4g + %.4g f^2 a second: T60 = 6.91 s over that\n",
                 law->a, law->b);
    scene.network = with_decay(scene.network, *law);
  }
  if (!options.frequencies_hz.empty()) {
    auto tuned = tune_modes(scene.network, parameters, options.frequencies_hz, search);
    if (!tuned) {
      return tuned.error();
    }
    if (!scene.network.macros.empty() && tuned->macros.empty() && !scene.network.taps.empty()) {
      std::fprintf(stderr,
                   "strings and meshes are written out mass by mass; inputs and outputs "
                   "between their masses are at the nearest one\n");
    }
    scene.network = *std::move(tuned);
  }
  return Done{};
}

void tell(const Scene& scene, const KnownModes& modes) {
  std::printf(
      "%s: %s%s of %s, %s\n", scene.path.c_str(), modes.is_all ? "" : "the lowest ",
      counted(modes.modes.size(), "mode", "modes").c_str(),
      counted(modes.masses, "mass that moves", "masses that move").c_str(),
      modes.scheme == ModeScheme::published
          ? ("as the published scheme plays them at " + fixed(modes.rate_hz, 0) + " Hz").c_str()
          : "of the continuous network");
  if (!modes.is_linear) {
    std::printf(
        "at rest: what bows, plucks or touches is open, and springs that stiffen are as they "
        "begin\n");
  }
  if (has_waveguide(scene.network)) {
    std::printf("without the waveguides, whose partials are no modes, and what holds on to them\n");
  }
  std::printf("%s\n", to_table(modes).c_str());
}

}  // namespace

int modes_command(const ModesOptions& options) {
  const bool is_tuning = !options.frequencies_hz.empty() || !options.decay.empty();
  const std::string wanted = is_tuning ? ".mdl" : ".svg";
  if (!options.output.empty() && !options.output.ends_with(wanted)) {
    return refuse("-o: expected a file that ends in " + wanted + ", found '" + options.output +
                  "'");
  }
  LoadNews news(options.name,
                [](const std::string& text) { std::fprintf(stderr, "%s\n", text.c_str()); });
  const Progress progress([&](std::string_view stage) {
    news.at(stage);
    return true;  // Ctrl-C ends it at once
  });
  auto scene = load_scene(options.name, {.third = options.third, .progress = progress});
  if (!scene) {
    return refuse(scene.error().message);
  }
  for (const std::string& warning : scene->warnings) {
    std::fprintf(stderr, "%s\n", warning.c_str());
  }
  const std::string read[] = {scene->path, scene->model_path};
  if (auto spared = spare(options.output, read); !spared) {
    return refuse(spared.error().message);
  }
  const std::vector<double> parameters = start_values(*scene);
  const ModeOptions search{
      .rate_hz = options.rate_hz,
      .scheme = options.is_continuous ? ModeScheme::continuous : ModeScheme::published,
      .count = options.count,
      .progress = progress};
  const std::string as_written = options.output.empty() || is_tuning ? "" : scene->name;
  if (auto tuned = tune(*scene, parameters, options, search); !tuned) {
    return refuse(to_string(finding_of(scene->model_path, "", tuned.error())));
  }
  std::string file;
  Result<KnownModes> modes = Error{};
  if (!as_written.empty()) {
    const auto found = find_modes(scene->network, parameters, search);
    if (found) {
      file = shapes_svg(*found, scene->network, as_written);
      modes = known_modes(*found);
    } else {
      modes = found.error();
    }
  } else {
    modes = known_modes(*scene, parameters, search);
    file = is_tuning ? print_network(scene->network) : "";
  }
  if (!modes) {
    return refuse(to_string(finding_of(scene->model_path, "", modes.error())));
  }
  // What is told of modes is not all that it does: what runs away without swinging is no mode.
  if (search.scheme == ModeScheme::published) {
    if (const auto warning = instability(*scene, parameters, search.rate_hz, progress)) {
      std::fprintf(stderr, "%s\n", to_string(*warning).c_str());
    }
  }
  if (!options.output.empty()) {
    if (const int code = put_text(options.output, file, options.force); code != exit_code::done) {
      return code;
    }
  }
  if (options.as_json) {
    std::printf("%s\n", to_json(*modes).c_str());
  } else {
    tell(*scene, *modes);
  }
  return exit_code::done;
}

}  // namespace ressort::commands
