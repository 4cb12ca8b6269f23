#include "app/commands/modes/modes.h"

#include <cstdio>

#include "app/commands/modes/shapes_figure.h"
#include "app/commands/output.h"
#include "app/exit_code.h"
#include "app/session/compile_scene.h"
#include "app/session/files.h"
#include "app/session/loader.h"
#include "app/session/modes/known_modes.h"
#include "app/text.h"
#include "core/analysis/modes/tune.h"
#include "core/model/language/print.h"
#include "core/model/topology.h"

namespace ressort::commands {
namespace {

// Applies --decay and --tune to the scene.
Result<Done> tune(Scene& scene, const std::vector<double>& parameters, const ModesOptions& options,
                  const ModeOptions& search) {
  if (!options.decay.empty()) {
    const auto law = decay_law(options.decay);
    if (!law) {
      return law.error();
    }
    std::fprintf(stderr,
                 "decay rate of every mode: %.4g + %.4g f^2 per second; T60 = 6.91 / rate\n",
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
                   "strings and meshes are written mass by mass; inputs and outputs move to the "
                   "nearest mass\n");
    }
    scene.network = *std::move(tuned);
  }
  return Done{};
}

void print_modes(const Scene& scene, const KnownModes& modes) {
  std::printf("%s: %s%s of %s, %s\n", scene.path.c_str(), modes.is_all ? "" : "the lowest ",
              counted(modes.modes.size(), "mode", "modes").c_str(),
              counted(modes.masses, "moving mass", "moving masses").c_str(),
              modes.scheme == ModeScheme::published
                  ? ("in the published scheme at " + fixed(modes.rate_hz, 0) + " Hz").c_str()
                  : "in the continuous network");
  if (!modes.is_linear) {
    std::printf(
        "at rest: bows, plucks and contacts do not touch, and nonlinear springs are linearised\n");
  }
  if (has_waveguide(scene.network)) {
    std::printf("waveguides and the links to them are left out\n");
  }
  std::printf("%s\n", to_table(modes).c_str());
}

}  // namespace

int modes_command(const ModesOptions& options) {
  const bool is_tuning = !options.frequencies_hz.empty() || !options.decay.empty();
  const std::string wanted = is_tuning ? ".mdl" : ".svg";
  if (!options.output.empty() && !options.output.ends_with(wanted)) {
    return reject("-o: expected a file that ends in " + wanted + ", found '" + options.output +
                  "'");
  }
  if (auto found = plot::check_gnuplot(); !options.output.empty() && !is_tuning && !found) {
    return reject(options.output + ": " + found.error().message);
  }
  const Progress progress = report_stages(options.name);
  auto scene = load_scene(options.name, {.third = options.third, .progress = progress});
  if (!scene) {
    return reject(scene.error().message);
  }
  for (const std::string& warning : scene->warnings) {
    print_error(warning);
  }
  const std::string read[] = {scene->path, scene->model_path};
  if (auto spared = check_not_input(options.output, read); !spared) {
    return reject(spared.error().message);
  }
  const std::vector<double> parameters = start_values(*scene);
  const ModeOptions search{
      .rate_hz = options.rate_hz,
      .scheme = options.is_continuous ? ModeScheme::continuous : ModeScheme::published,
      .count = options.count,
      .progress = progress};
  const std::string as_written = options.output.empty() || is_tuning ? "" : scene->name;
  if (auto tuned = tune(*scene, parameters, options, search); !tuned) {
    return reject(to_string(finding_of(scene->model_path, "", tuned.error())));
  }
  plot::Figure figure;
  Result<KnownModes> modes = Error{};
  if (!as_written.empty()) {
    const auto found = find_modes(scene->network, parameters, search);
    if (found) {
      figure = network_shapes_figure(*found, scene->network, as_written);
      modes = known_modes(*found);
    } else {
      modes = found.error();
    }
  } else {
    modes = known_modes(*scene, parameters, search);
  }
  if (!modes) {
    return reject(to_string(finding_of(scene->model_path, "", modes.error())));
  }
  // Warns about divergence without oscillation, which is not a mode.
  if (search.scheme == ModeScheme::published) {
    if (const auto warning = instability(*scene, parameters, search.rate_hz, progress)) {
      print_error(to_string(*warning));
    }
  }
  if (!options.output.empty()) {
    if (const int code =
            is_tuning ? write_output(options.output, print_network(scene->network), options.force)
                      : put_figure(options.output, figure, options.force)) {
      return code;
    }
  }
  if (options.as_json) {
    std::printf("%s\n", to_json(*modes).c_str());
  } else {
    print_modes(*scene, *modes);
  }
  return exit_code::done;
}

}  // namespace ressort::commands
