// app/session: a model or preset turned to the timbre that somebody asks for.
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

// "centroid" or "centroid_hz"; the error lists them all.
Result<AskedFigure> asked_figure(const std::string& word);

// Without its unit: "centroid", as options and messages have it.
std::string short_name(AskedFigure figure);

struct ShapeRequest {
  const Scene& scene;
  const std::vector<ParameterInfo>& parameters;  // with the ranges that are stable
  std::vector<double> values;                    // [parameter] as they are
  bool has_keys = false;                         // keys set the pitch
  int key = 57;                                  // which is described then
  double rate_hz = Network::reference_rate_hz;
  Progress progress = {};
  std::function<void(double share)> tell = {};
};

struct Shaped {
  AskedTimbre found;
  std::vector<TimbreTarget> targets;
  std::vector<std::string> names;  // [parameter]
  std::string of;                  // what was described, for people
};

// Nothing changes but what comes back. The error says what is in the way: it is not linear, nothing
// may be turned, a target that is none; or `stopped`. Blocks. [any thread but audio]
Result<Shaped> shape_timbre(const ShapeRequest& request, std::vector<TimbreTarget> targets);

// Pairs of NAME VALUE that read as the parameters that were found, where they changed.
struct ShapedParameter {
  std::string name;
  double value = 0.0;
};
std::vector<ShapedParameter> changed(const Shaped& shaped, std::span<const double> before);

// A table: asked, before, reached and how far that is off; then, of each that was not reached, why.
std::string to_text(const Shaped& shaped);

// A sentence for each target that was not reached: "as bright as it gets is 1,412 Hz: m_K is at its
// highest".
std::vector<std::string> missed(const Shaped& shaped);

}  // namespace ressort::session
