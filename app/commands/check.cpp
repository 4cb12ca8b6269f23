#include "app/commands/check.h"
#include "app/commands/output.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "app/exit_code.h"
#include "app/session/compile_scene.h"
#include "app/session/files.h"
#include "app/session/loader.h"
#include "app/session/memory.h"
#include "app/session/timing.h"
#include "app/text.h"
#include "core/analysis/stability.h"
#include "core/compile/compile.h"
#include "core/compile/schemes.h"
#include "core/model/language/print.h"
#include "core/model/topology.h"

namespace ressort::commands {
namespace {

using nlohmann::json;

void print_findings(const std::vector<Finding>& findings) {
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

// Results of the stability analysis of a scene.
struct Proved {
  std::string file;         // the body that `certificate` is about; empty: the model
  Certificate certificate;  // proof for all of the preset's ranges, or for the model's own values
  double stiffness_factor = 0.0;
  bool is_exact = true;     // false: by a bound
  bool others_move = true;  // the limits hold for all values of the other parameters
  std::vector<std::optional<SafeRange>> safe;  // [parameter]
};

// Returns the box of the start values only.
ParameterBox start_box(const std::vector<ParameterInfo>& parameters) {
  ParameterBox box;
  for (const ParameterInfo& info : parameters) {
    box.lowest.push_back(info.value);
    box.highest.push_back(info.value);
  }
  return box;
}

// Returns the common part of two ranges.
std::optional<SafeRange> common(const std::optional<SafeRange>& a,
                                const std::optional<SafeRange>& b) {
  return a && b ? std::optional(
                      SafeRange{std::max(a->lowest, b->lowest), std::min(a->highest, b->highest)})
                : std::nullopt;
}

// Analyses the model, or a body of the preset.
Proved prove(const StabilityCheck& check, const std::vector<ParameterInfo>& parameters,
             const Preset& preset, const Progress& progress) {
  const ParameterBox box = preset_box(parameters, preset);
  Stability stability(check.proved, 1.0, Stability::most_exact_masses, progress);
  progress.stage("checking the stability in all ranges");
  Proved proved{.certificate = stability.certify(box),
                .stiffness_factor = stability.stiffness_factor(box)};
  proved.others_move = proved.certificate.verdict == Verdict::stable;
  proved.is_exact = stability.is_exact();
  progress.stage("finding the limits of the parameters");
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    proved.safe.push_back(stability.safe_range(proved.others_move ? box : start_box(parameters), i,
                                               parameters[i].value));
  }
  return proved;
}

Proved prove(const Scene& scene, const Compiled& compiled, const Progress& progress) {
  const std::vector<ParameterInfo>& parameters = compiled.instrument.parameters;
  Proved proved = prove(compiled.stability, parameters, scene.preset, progress);
  for (const CompiledBody& body : compiled.bodies) {
    const std::vector<ParameterInfo>& own = body.stability.parameters;
    const Proved other = prove(body.stability, own, scene.preset, progress);
    for (std::size_t i = 0; i < parameters.size(); ++i) {
      for (std::size_t k = 0; k < own.size(); ++k) {
        if (own[k].name == parameters[i].name) {
          proved.safe[i] = common(proved.safe[i], other.safe[k]);
        }
      }
    }
    proved.others_move = proved.others_move && other.others_move;
    proved.is_exact = proved.is_exact && other.is_exact;
    if (proved.certificate.verdict == Verdict::stable) {
      proved.certificate = other.certificate;
      proved.file = other.certificate.verdict == Verdict::stable ? "" : body.file;
    }
  }
  return proved;
}

constexpr const char* verdict_names[] = {"stable", "unstable", "unproved"};  // [Verdict]

std::string describe(const std::optional<SafeRange>& safe) {
  return safe ? describe(*safe) : "stable nowhere";
}

json limit_json(double value) {
  return std::isfinite(value) ? json(value) : json();
}

json parameter_json(const ParameterInfo& info, int input, const std::optional<SafeRange>& safe) {
  json out{{"name", info.name}};
  if (input > 0) {
    out.update({{"input", input},
                {"minimum", limit_json(info.minimum)},
                {"maximum", limit_json(info.maximum)}});
  } else {
    out.update({{"value", info.value}, {"minimum", info.minimum}, {"maximum", info.maximum}});
  }
  // Missing limits are null. A parameter that is stable nowhere has no limits.
  if (safe) {
    out["stable_above"] = limit_json(safe->lowest);
    out["stable_below"] = limit_json(safe->highest);
  }
  return out;
}

json stability_json(const Proved& proved) {
  json out{{"verdict", verdict_names[static_cast<std::size_t>(proved.certificate.verdict)]},
           {"limits_hold", proved.others_move ? "in all ranges" : "at the initial values"},
           {"stiffness_factor", limit_json(proved.stiffness_factor)}};
  if (const std::optional<Culprit>& culprit = proved.certificate.culprit) {
    out["culprit"] = {{"name", culprit->name},
                      {"line", culprit->location.line},
                      {"quantity", quantity_name(culprit->quantity)},
                      {"argument", culprit->argument},
                      {"value", limit_json(culprit->value)},
                      {"limit", culprit->limit ? json(*culprit->limit) : json()}};
  }
  return out;
}

// Returns the deviations as JSON; unknown numbers are null.
json accuracy_json(const Accuracy& accuracy) {
  const auto figure = [&](double value) { return accuracy.is_known ? limit_json(value) : json(); };
  return {{"cents", figure(accuracy.cents)},
          {"t60_percent", figure(accuracy.t60_percent)},
          {"is_bound", accuracy.is_bound}};
}

// Returns a budget of pitch or decay as JSON; "kept" is null if unknown.
json budget_json(const Plan& plan) {
  json out = accuracy_json(*plan.accuracy);
  out["asked"] = print_budget(plan.budget);
  out["kept"] = plan.accuracy->is_known ? json(plan.accuracy->meets(plan.budget)) : json();
  return out;
}

json scene_json(const Scene& scene, const Compiled& compiled, const Proved& proved) {
  const Instrument& instrument = compiled.instrument;
  json parameters = json::array();
  for (std::size_t i = 0; i < instrument.parameters.size(); ++i) {
    parameters.push_back(parameter_json(instrument.parameters[i],
                                        scene.network.parameters[i].audio_input, proved.safe[i]));
    const std::string curve = curve_text(scene.preset, instrument.parameters[i].name);
    if (!curve.empty()) {
      parameters.back()["curve"] = curve;
    }
  }
  json plan = json::array();
  for (const Part& part : compiled.plan.parts) {
    plan.push_back({{"method", method_name(part.method)},
                    {"masses", part.masses},
                    {"links", part.links},
                    {"estimated_ns", part.estimated_ns},
                    {"reason", part.reason}});
    if (!part.body.empty()) {
      plan.back()["body"] = part.body;
    }
    if (part.accuracy) {
      plan.back()["off"] = accuracy_json(*part.accuracy);
    }
  }
  const char* const motion = !scene.third                                         ? "either"
                             : *scene.third == ThirdArgument::velocity_per_second ? "velocity"
                                                                                  : "delayed";
  json out{{"file", scene.path},
           {"model", scene.model_path},
           {"motion", motion},
           {"motion_reason", scene.motion},
           {"masses", instrument.masses},
           {"links", instrument.links},
           {"inputs", instrument.inputs.size()},
           {"outputs", instrument.outputs},
           {"parameters", parameters},
           {"plan", plan},
           {"precision", precision_name(compiled.plan.precision)},
           {"stability", stability_json(proved)},
           {"stiffness_margin", instrument.stiffness_margin}};
  if (compiled.plan.accuracy) {
    out["budget"] = budget_json(compiled.plan);
  }
  if (instrument.mode) {
    out["lowest_mode_hz"] = instrument.mode->frequency_hz;
  }
  return out;
}

void add_warning(Finding finding, std::vector<Finding>& findings) {
  finding.diagnostic.severity = Severity::warning;
  findings.push_back(std::move(finding));
}

// Reports the element that makes the scene unstable, at its line of the model.
void warn(const Proved& proved, const Scene& scene, std::vector<Finding>& findings) {
  if (!proved.certificate.culprit) {
    return;
  }
  const Error error = complaint(proved.certificate);
  add_warning(
      proved.file.empty() ? finding_in_model(scene, error) : finding_in_file(proved.file, error),
      findings);
}

// Warns if the CPU is too slow for all voices.
void warn(const Scene& scene, const Compiled& compiled, std::vector<Finding>& findings) {
  const std::string text = overload_warning(compiled, CompileOptions(), {.time = cpu_time_ns});
  if (!text.empty()) {
    add_warning(finding_of(scene.path, "", Error{text}), findings);
  }
}

std::string by_bound(const Proved& proved) {
  return proved.is_exact ? "" : "; for a network of this size only a conservative bound is checked";
}

// Returns the last line of the report.
std::string conclusion(const Scene& scene, const Proved& proved) {
  const bool has_ranges = !scene.preset.parameters.empty();
  switch (proved.certificate.verdict) {
    case Verdict::stable:
      break;
    case Verdict::unstable:
      return has_ranges
                 ? "not stable in all ranges of the parameters; the limits above hold for one "
                   "parameter while the others keep their initial values"
                 : "not stable; the limits above hold for one parameter while the others keep "
                   "their values";
    case Verdict::unproved:
      return "not proved stable" + by_bound(proved);
  }
  std::string text = has_ranges ? "stable in all ranges of the parameters" : "stable";
  const auto& parameters = scene.network.parameters;
  if (std::ranges::any_of(parameters,
                          [](const Parameter& parameter) { return parameter.audio_input > 0; })) {
    text += has_ranges ? "" : " at the initial values";
    text += ", while the inputs stay within the limits above";
  }
  if (std::isfinite(proved.stiffness_factor)) {
    text += "; every stiffness may be multiplied by up to " +
            print_limit(proved.stiffness_factor, true);
  }
  return text + by_bound(proved);
}

void print_report(const Scene& scene, const Compiled& compiled, const Proved& proved) {
  const Instrument& instrument = compiled.instrument;
  std::printf("%s: %s, %s, %s, %s\n", scene.path.c_str(),
              counted(instrument.masses, "moving mass", "moving masses").c_str(),
              counted(instrument.links, "link", "links").c_str(),
              counted(instrument.inputs.size(), "input", "inputs").c_str(),
              counted(static_cast<std::size_t>(instrument.outputs), "output", "outputs").c_str());
  std::printf("motion: %s\n", scene.motion.c_str());
  for (std::size_t i = 0; i < instrument.parameters.size(); ++i) {
    const ParameterInfo& info = instrument.parameters[i];
    const std::string safe = describe(proved.safe[i]);
    if (const int input = scene.network.parameters[i].audio_input; input > 0) {
      std::printf("  %-12s audio input %d, from %g to %g; %s\n", info.name.c_str(), input,
                  info.minimum, info.maximum, safe.c_str());
    } else {
      const std::string curve = curve_text(scene.preset, info.name);
      std::printf("  %-12s %-10g from %g to %g; %s%s%s\n", info.name.c_str(), info.value,
                  info.minimum, info.maximum, safe.c_str(), curve.empty() ? "" : "; ",
                  curve.c_str());
    }
  }
  std::printf("methods:\n  %s", describe(compiled.plan).c_str());
  if (instrument.mode) {
    std::printf("lowest mode %.3f Hz; keys sound up to %.0f Hz, higher keys are silent\n",
                instrument.mode->frequency_hz, instrument.highest_frequency_hz);
  }
  const auto hazard =
      choose_schemes(expand_macros(scene.network), {.passive = Passivity::never}).hazard;
  if (!scene.has_preset && hazard) {
    std::printf(
        "played with notes: %s\nrendered without notes: not proved stable, because it is %s\n",
        conclusion(scene, proved).c_str(), hazard->message.c_str());
  } else {
    std::printf("%s\n", conclusion(scene, proved).c_str());
  }
}

}  // namespace

int check(const CheckOptions& options) {
  const Progress progress = report_stages(options.name);
  Reading reading = read_scene(options.name, {.third = options.third, .progress = progress});
  CompiledScene admission;
  if (reading.scene) {
    admission = compile_to_play(*reading.scene,
                                {.method = options.method,
                                 .budget = options.budget,
                                 .progress = progress,
                                 .most_bytes = free_memory_bytes()},
                                options.is_strict);
  }
  const std::optional<Compiled>& compiled = admission.compiled;
  const bool is_ok = compiled && admission.is_accepted();
  std::optional<Proved> proved;
  if (compiled && options.as != CheckAs::model) {
    proved = prove(*reading.scene, *compiled, progress);
    const bool is_told = compiled->stability.complaint ||
                         std::ranges::any_of(compiled->bodies, [](const CompiledBody& body) {
                           return body.stability.complaint.has_value();
                         });
    if (!is_told) {
      warn(*proved, *reading.scene, reading.findings);
    }
    warn(*reading.scene, *compiled, reading.findings);
  }
  for (Finding& finding : admission.findings) {
    reading.findings.push_back(std::move(finding));
  }
  if (options.as == CheckAs::json) {
    json out = compiled ? scene_json(*reading.scene, *compiled, *proved) : json::object();
    out["ok"] = is_ok;
    out["findings"] = findings_json(reading.findings);
    // Names may have any encoding; invalid UTF-8 is replaced.
    std::printf("%s\n", out.dump(2, ' ', false, json::error_handler_t::replace).c_str());
  } else {
    print_findings(reading.findings);
  }
  if (!compiled) {
    return exit_code::wrong_use;
  }
  // Also reports on models that may not be played, because that helps to repair them.
  if (options.as == CheckAs::report) {
    print_report(*reading.scene, *compiled, *proved);
  } else if (options.as == CheckAs::model) {
    const std::string text = print_network(reading.scene->network);
    std::fwrite(text.data(), 1, text.size(), stdout);
  }
  return is_ok ? exit_code::done : exit_code::wrong_use;
}

}  // namespace ressort::commands
