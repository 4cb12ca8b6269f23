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
    return reject("-o: expected a FAUST file such as NAME.dsp, found '" + options.output + "'");
  }
  const Progress progress = report_stages(options.name);
  const auto scene = load_scene(options.name, {.third = options.third, .progress = progress});
  if (!scene) {
    return reject(scene.error().message);
  }
  if (!scene->preset.bodies.empty()) {
    const SourceLocation at = scene->preset.through_location;
    const Error error{
        "the models of 'through' cannot be exported with the voices; export each "
        "model by its own name and join them with ':'",
        at.line, at.column};
    return reject(to_string(finding_of(scene->path, "", error)));
  }
  for (const std::string& warning : scene->warnings) {
    print_error(warning);
  }
  const std::string read[] = {scene->path, scene->model_path};
  if (auto spared = check_not_input(options.output, read); !spared) {
    return reject(spared.error().message);
  }
  const auto text = to_faust(*scene, options.rescale, progress);
  if (!text) {
    return reject(text.error().message);
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
  if (const int failure = write_output(options.output, *text, options.force)) {
    return failure;
  }
  std::printf("%s: %s as a FAUST program of %zu bytes\n", options.output.c_str(),
              scene->name.c_str(), text->size());
  return exit_code::done;
}

}  // namespace ressort::commands
