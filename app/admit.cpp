#include "app/admit.h"

#include "app/files.h"

namespace ressort {
namespace {

Finding at(const std::string& path, std::size_t most_bytes, const Error& error, Severity severity) {
  const auto text = read_text(path, most_bytes);
  Finding finding = finding_of(path, text ? std::string_view(*text) : "", error);
  finding.diagnostic.severity = severity;
  return finding;
}

}  // namespace

std::vector<Finding> narrowed_ranges(const Scene& scene, const Gate& gate) {
  std::vector<Finding> findings;
  for (const Error& narrowed : gate.narrowed) {
    findings.push_back(at(scene.path, max_preset_bytes, narrowed, Severity::warning));
  }
  return findings;
}

Result<Compiled> admit(const Scene& scene, const CompileOptions& options,
                       std::vector<std::string>& warnings) {
  auto compiled = compile(scene.network, scene.preset, options);
  if (!compiled) {
    return Error{to_string(at(scene.path, max_preset_bytes, compiled.error(), Severity::error))};
  }
  const Gate& gate = compiled->gate;
  if (gate.verdict == Verdict::unstable && !options.force) {
    Error error = *gate.complaint;
    error.message += "; --force plays it all the same, fading out what runs away";
    return Error{to_string(at(scene.model_path, max_model_bytes, error, Severity::error))};
  }
  if (gate.complaint) {
    warnings.push_back(
        to_string(at(scene.model_path, max_model_bytes, *gate.complaint, Severity::warning)));
  }
  for (const Finding& finding : narrowed_ranges(scene, gate)) {
    warnings.push_back(to_string(finding));
  }
  return compiled;
}

}  // namespace ressort
