// app/session: adjusts a model's parameters to a target timbre.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "app/session/loader.h"
#include "core/analysis/timbre/ask.h"
#include "core/compile/instrument.h"
#include "core/progress.h"
#include "core/result.h"

namespace ressort::session {

// Parses "centroid" or "centroid_hz". The error lists all figures.
Result<TargetFigure> parse_target_figure(const std::string& word);

// Returns the name without its unit: "centroid".
std::string short_name(TargetFigure figure);

struct ShapeRequest {
  const Scene& scene;
  const std::vector<ParameterInfo>& parameters;  // parameters with their stable ranges
  std::vector<double> values;                    // [parameter] present values
  bool has_keys = false;                         // keys set the pitch
  int key = 57;                                  // the key whose timbre is adjusted
  double rate_hz = Network::reference_rate_hz;
  Progress progress = {};
  std::function<void(double share)> on_progress = {};
};

struct Shaped {
  FoundTimbre found;
  std::vector<TimbreTarget> targets;
  std::vector<std::string> names;  // [parameter]
  std::string of;                  // description of the sound, for people
};

// Finds the parameters. Changes nothing else. Errors: a nonlinear model, no adjustable parameter,
// an invalid target, or `stopped`. Blocks. [any thread but audio]
Result<Shaped> shape_timbre(const ShapeRequest& request, std::vector<TimbreTarget> targets);

// The parameters that changed, printed as pairs NAME VALUE.
struct ShapedParameter {
  std::string name;
  double value = 0.0;
};
std::vector<ShapedParameter> changed(const Shaped& shaped, std::span<const double> before);

// Returns a table of target, start and result with the deviation, followed by missed().
std::string to_text(const Shaped& shaped);

// Returns a sentence for each target that was missed, with the reason: "1,412 Hz is as bright as it
// gets: m_K is at its highest".
std::vector<std::string> missed(const Shaped& shaped);

}  // namespace ressort::session
