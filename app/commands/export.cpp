#include "app/commands/export.h"
#include "app/commands/output.h"

#include <cstdio>

#include "app/exit_code.h"
#include "app/session/files.h"
#include "app/session/loader.h"
#include "core/compile/compile.h"
#include "core/model/faust/faust.h"

namespace ressort::commands {
namespace {

// The sliders have the ranges of the parameters when they are played.
Result<std::string> to_faust(const Scene& scene, bool rescale, const Progress& progress) {
  const auto compiled =
      compile_network(scene.network, scene.preset, {.voices = 1, .progress = progress});
  if (!compiled) {
    return Error{to_string(finding_of(scene.path, "", compiled.error()))};
  }
  std::vector<ParameterSetting> sliders;
  for (const ParameterInfo& info : compiled->instrument.parameters) {
    sliders.push_back({info.name, info.value, info.minimum, info.maximum, {}});
  }
  progress.stage("generating FAUST code");
  auto text =
      faust_text(scene.network, {.name = scene.name, .sliders = sliders, .rescale = rescale});
  if (!text) {
    return Error{to_string(finding_in_model(scene, text.error()))};
  }
  return text;
}

}  // namespace

int export_to_faust(const ExportOptions& options) {
  if (options.output.ends_with(".mdl") || options.output.ends_with(".toml")) {
    std::fprintf(stderr, "-o: expected a FAUST file such as NAME.dsp, found '%s'\n",
                 options.output.c_str());
    return exit_code::wrong_use;
  }
  const Progress progress = report_stages(options.name);
  const auto scene = load_scene(options.name, {.third = options.third, .progress = progress});
  if (!scene) {
    std::fprintf(stderr, "%s\n", scene.error().message.c_str());
    return exit_code::wrong_use;
  }
  if (!scene->preset.bodies.empty()) {
    const SourceLocation at = scene->preset.through_location;
    const Error error{
        "the models of 'through' cannot be exported with the voices; export each "
        "model by its own name and join them with ':'",
        at.line, at.column};
    std::fprintf(stderr, "%s\n", to_string(finding_of(scene->path, "", error)).c_str());
    return exit_code::wrong_use;
  }
  for (const std::string& warning : scene->warnings) {
    std::fprintf(stderr, "%s\n", warning.c_str());
  }
  const std::string read[] = {scene->path, scene->model_path};
  if (auto spared = check_not_input(options.output, read); !spared) {
    std::fprintf(stderr, "%s\n", spared.error().message.c_str());
    return exit_code::wrong_use;
  }
  const auto text = to_faust(*scene, options.rescale, progress);
  if (!text) {
    std::fprintf(stderr, "%s\n", text.error().message.c_str());
    return exit_code::wrong_use;
  }
  if (const std::size_t count = faust_elements(scene->network);
      count > comfortable_faust_elements) {
    std::fprintf(stderr, "warning: %zu masses and links; FAUST takes minutes for more than %zu\n",
                 count, comfortable_faust_elements);
  }
  if (options.output.empty()) {
    std::fputs(text->c_str(), stdout);
    return exit_code::done;
  }
  return write_output(options.output, *text, options.force);
}

}  // namespace ressort::commands
