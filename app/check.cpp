#include "app/check.h"

#include <unistd.h>

#include <cstdio>
#include <nlohmann/json.hpp>

#include "app/exit_code.h"
#include "app/loader.h"
#include "app/text.h"
#include "core/compile/compile.h"
#include "core/model/print.h"

namespace ressort {
namespace {

using nlohmann::json;

void tell(const std::vector<Finding>& findings) {
  const bool is_terminal = isatty(STDERR_FILENO) != 0;
  for (const Finding& finding : findings) {
    const std::string text = is_terminal ? with_source(finding) : to_string(finding);
    std::fprintf(stderr, "%s\n", text.c_str());
  }
}

json findings_json(const std::vector<Finding>& findings) {
  json out = json::array();
  for (const Finding& finding : findings) {
    const Diagnostic& diagnostic = finding.diagnostic;
    out.push_back({{"severity", diagnostic.severity == Severity::error ? "error" : "warning"},
                   {"file", finding.file},
                   {"line", diagnostic.line},
                   {"column", diagnostic.column},
                   {"length", diagnostic.length},
                   {"message", diagnostic.message},
                   {"source", finding.source}});
  }
  return out;
}

json scene_json(const Scene& scene, const Compiled& compiled) {
  const Instrument& instrument = compiled.instrument;
  json parameters = json::array();
  for (std::size_t i = 0; i < instrument.parameters.size(); ++i) {
    const ParameterInfo& info = instrument.parameters[i];
    if (const int input = scene.network.parameters[i].audio_input; input > 0) {
      parameters.push_back({{"name", info.name}, {"input", input}});
    } else {
      parameters.push_back({{"name", info.name},
                            {"value", info.value},
                            {"minimum", info.minimum},
                            {"maximum", info.maximum}});
    }
  }
  json plan = json::array();
  for (const Part& part : compiled.plan.parts) {
    plan.push_back({{"method", method_name(part.method)},
                    {"masses", part.masses},
                    {"links", part.links},
                    {"predicted_ns", part.predicted_ns},
                    {"reason", part.reason}});
  }
  const bool is_velocity = scene.network.third == ThirdArgument::velocity_per_second;
  json out{{"file", scene.path},
           {"model", scene.model_path},
           {"motion", is_velocity ? "velocity" : "delayed"},
           {"motion_reason", scene.motion},
           {"masses", instrument.masses},
           {"links", instrument.links},
           {"inputs", instrument.inputs.size()},
           {"outputs", instrument.outputs},
           {"parameters", parameters},
           {"plan", plan},
           {"stiffness_margin", instrument.stiffness_margin}};
  if (instrument.mode) {
    out["lowest_mode_hz"] = instrument.mode->frequency_hz;
  }
  return out;
}

void print_report(const Scene& scene, const Compiled& compiled) {
  const Instrument& instrument = compiled.instrument;
  std::printf("%s: %s, %s, %s, %s\n", scene.path.c_str(),
              counted(instrument.masses, "mass that moves", "masses that move").c_str(),
              counted(instrument.links, "link", "links").c_str(),
              counted(instrument.inputs.size(), "input", "inputs").c_str(),
              counted(static_cast<std::size_t>(instrument.outputs), "output", "outputs").c_str());
  std::printf("motion: %s\n", scene.motion.c_str());
  for (std::size_t i = 0; i < instrument.parameters.size(); ++i) {
    const ParameterInfo& info = instrument.parameters[i];
    if (const int input = scene.network.parameters[i].audio_input; input > 0) {
      std::printf("  %-12s is input %d, sample by sample\n", info.name.c_str(), input);
    } else {
      std::printf("  %-12s %-10g from %g to %g\n", info.name.c_str(), info.value, info.minimum,
                  info.maximum);
    }
  }
  std::printf("runs as\n  %s", describe(compiled.plan).c_str());
  if (instrument.mode) {
    std::printf(
        "lowest mode %.3f Hz; keys are in tune up to %.0f Hz, higher ones come down by "
        "octaves\n",
        instrument.mode->frequency_hz, instrument.highest_frequency_hz);
  }
  if (instrument.masses > most_tuned_masses) {
    std::printf("keys do not set the pitch: above %zu masses the lowest mode is not looked for\n",
                most_tuned_masses);
  }
  if (instrument.stiffness_margin >= 1.0) {
    std::printf("stable: every stiffness may grow by %.3g at least\n", instrument.stiffness_margin);
  } else {
    std::printf(
        "warning: stability is not proved; stiffness and damping may be too high for the "
        "masses (margin %.3g)\n",
        instrument.stiffness_margin);
  }
}

}  // namespace

int check(const CheckOptions& options) {
  Reading reading = read_scene(options.name, {.third = options.third});
  std::optional<Compiled> compiled;
  if (reading.scene) {
    auto made = compile(reading.scene->network, reading.scene->preset, {.method = options.method});
    if (made) {
      compiled = *std::move(made);
    } else {
      reading.findings.push_back(finding_of(reading.scene->path, "", made.error()));
    }
  }
  if (options.as == CheckAs::json) {
    json out = compiled ? scene_json(*reading.scene, *compiled) : json::object();
    out["ok"] = compiled.has_value();
    out["findings"] = findings_json(reading.findings);
    // Names may be in any encoding; what is no UTF-8 is replaced.
    std::printf("%s\n", out.dump(2, ' ', false, json::error_handler_t::replace).c_str());
  } else {
    tell(reading.findings);
  }
  if (!compiled) {
    return exit_code::wrong_use;
  }
  if (options.as == CheckAs::report) {
    print_report(*reading.scene, *compiled);
  } else if (options.as == CheckAs::model) {
    const std::string text = print_network(reading.scene->network);
    std::fwrite(text.data(), 1, text.size(), stdout);
  }
  return exit_code::done;
}

}  // namespace ressort
