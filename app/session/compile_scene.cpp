#include "app/session/compile_scene.h"

#include <algorithm>

#include "app/session/files.h"
#include "core/analysis/stability.h"
#include "core/compile/stability_check.h"

namespace ressort::session {
namespace {

Finding in_model(const Scene& scene, const Error& error, Severity severity) {
  Finding finding = finding_in_model(scene, error);
  finding.diagnostic.severity = severity;
  return finding;
}

Finding in_body(const std::string& file, const Error& error, Severity severity) {
  Finding finding = finding_in_file(file, error);
  finding.diagnostic.severity = severity;
  return finding;
}

Finding in_preset(const Scene& scene, const Error& error) {
  const auto text = read_text(scene.path, max_preset_bytes);
  Finding finding = finding_of(scene.path, text ? std::string_view(*text) : "", error);
  finding.diagnostic.severity = Severity::warning;
  return finding;
}

}  // namespace

bool CompiledScene::is_accepted() const {
  return std::ranges::none_of(findings, [](const Finding& finding) {
    return finding.diagnostic.severity == Severity::error;
  });
}

CompiledScene compile_to_play(const Scene& scene, const CompileOptions& options, bool is_strict) {
  CompiledScene admission;
  auto compiled = compile_network(scene.network, scene.preset, options);
  if (!compiled) {
    // Preset errors were found while reading, so this one is in the model.
    admission.findings.push_back(in_model(scene, compiled.error(), Severity::error));
    return admission;
  }
  // `in_file` makes a finding in the model's file, or in a body's.
  const auto report = [&](const StabilityCheck& stability, const std::optional<Error>& hazard,
                          const std::optional<Error>& strong_bow, auto&& in_file) {
    if (stability.complaint) {
      const bool is_refused = stability.verdict == Verdict::unstable && !options.force;
      Error complaint = *stability.complaint;
      complaint.message += is_refused ? "; pass --force to play it anyway" : "";
      admission.findings.push_back(
          in_file(complaint, is_refused ? Severity::error : Severity::warning));
    }
    for (const Error& narrowed : stability.narrowed) {
      admission.findings.push_back(in_preset(scene, narrowed));
    }
    if (hazard) {
      admission.findings.push_back(in_file(*hazard, Severity::warning));
    }
    if (strong_bow) {
      admission.findings.push_back(
          in_file(*strong_bow, is_strict ? Severity::error : Severity::warning));
    }
  };
  report(compiled->stability, compiled->schemes.hazard, compiled->strong_bow,
         [&](const Error& error, Severity severity) { return in_model(scene, error, severity); });
  for (const CompiledBody& body : compiled->bodies) {
    report(
        body.stability, body.hazard, body.strong_bow,
        [&](const Error& error, Severity severity) { return in_body(body.file, error, severity); });
  }
  const std::vector<Part>& parts = compiled->plan.parts;
  const auto broken = missed_budget(compiled->plan);
  if (broken && std::ranges::none_of(parts, &Part::may_gain)) {
    Finding finding = finding_of(scene.path, "", Error{*broken});
    finding.diagnostic.severity = is_strict ? Severity::error : Severity::warning;
    admission.findings.push_back(std::move(finding));
  }
  admission.compiled = *std::move(compiled);
  return admission;
}

Result<Compiled> compile_scene(const Scene& scene, const CompileOptions& options,
                               std::vector<std::string>& warnings, bool is_strict) {
  CompiledScene admission = compile_to_play(scene, options, is_strict);
  std::string errors;
  for (const Finding& finding : admission.findings) {
    if (finding.diagnostic.severity == Severity::error) {
      errors += (errors.empty() ? "" : "\n") + to_string(finding);
    } else {
      warnings.push_back(to_string(finding));
    }
  }
  if (!errors.empty()) {
    return Error{std::move(errors)};
  }
  return *std::move(admission.compiled);
}

std::optional<Finding> instability(const Scene& scene, const std::vector<double>& parameters,
                                   double rate_hz, const Progress& progress) {
  Stability stability(scene.network, Network::reference_rate_hz / rate_hz,
                      Stability::most_exact_masses, progress);
  const Certificate certificate = stability.certify({.lowest = parameters, .highest = parameters});
  return certificate.verdict == Verdict::unstable
             ? std::optional(in_model(scene, complaint(certificate), Severity::warning))
             : std::nullopt;
}

}  // namespace ressort::session
