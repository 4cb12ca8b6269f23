// core/compile: what may be played. Proves the part of a network that is always felt, narrows the
// parameters' ranges to where it stays proved, and finds what is left of the stiffness for keys.
#pragma once

#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/analysis/stability.h"
#include "core/compile/machine.h"
#include "core/engine/engine.h"
#include "core/model/network.h"
#include "core/model/preset/preset.h"
#include "core/progress.h"
#include "core/result.h"

namespace ressort::compile {

// A network of more masses gets its ranges by the edge bound: the exact ones would be waited for.
inline constexpr std::size_t most_quick_masses = 256;

// A parameter as people reach it: by name, in its own unit, within its range.
struct ParameterInfo {
  std::string name;
  double value = 0.0;  // at the start
  double minimum = 0.0;
  double maximum = 0.0;
  int audio_input = 0;  // that gives it, sample by sample; nobody else can
  // Where it keeps what is always felt stable, wherever in their ranges the others are.
  SafeRange safe{-std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
  bool is_raised = false;   // the minimum is more than was asked for, for that
  bool is_lowered = false;  // the maximum is less
};

struct Setting {
  std::string parameter;
  double value = 0.0;
};

// What the parameters may be turned to: the preset's ranges; without one, a generous one. The bare
// network is research: there anything goes. Of a preset that fits and a network without macros.
std::vector<ParameterInfo> requested_ranges(const Network& network, const Preset& preset,
                                            bool bare);

// Where they start, the bare network's at the settings.
std::vector<double> start_values(const std::vector<ParameterInfo>& parameters,
                                 const std::vector<Setting>& settings, bool bare);

// Where the preset lets the parameters be turned to; those that it does not name stay. As it says,
// not as it was narrowed.
ParameterBox preset_box(const std::vector<ParameterInfo>& parameters, const Preset& preset);

struct StabilityRequest {
  const Network& written;   // to name what is to blame
  const Network& expanded;  // the same without macros
  const Preset& preset;
  const std::vector<ParameterInfo>& parameters;  // as requested_ranges() says
  std::span<const LinkScheme> schemes;           // [link] how forces are found; empty: as published
  std::span<const double> start;                 // [parameter] as start_values() says
  double rate_hz = 44100.0;
  double rate_ratio = 1.0;
  bool bare = false;                  // parameters go where `reach` says and nowhere else
  bool is_open = false;               // whatever comes of it
  const std::vector<Setting>& reach;  // values that parameters will be given later
  Progress progress = {};
};

struct StabilityCheck {
  Network proved;  // as written, without what its scheme keeps stable: what all this is about
  Verdict verdict = Verdict::stable;      // of the start, by what of it is always felt
  std::optional<Error> complaint;         // unless stable: of the model, with its line
  std::vector<ParameterInfo> parameters;  // in the ranges that are left to them
  std::vector<Error> narrowed;  // ranges that the preset gives and that are too wide; its lines
  std::vector<Limits> limits;   // [parameter] that nothing may leave; infinite where unknown
  bool is_together = false;     // too many parameters for a limit of each: all were narrowed alike
};

// Looks at the start; if that is proved, widens it to the ranges of the parameters as far as the
// whole of their box is proved. A start that is not proved keeps its ranges. O(links) where the
// edge bound says yes. [any thread but audio]
StabilityCheck check_stability(const StabilityRequest& request);

// Where the preset lets the parameters be turned to, within the ranges that are left to them.
ParameterBox proved_box(const StabilityCheck& check, const Preset& preset);

// Factors on every stiffness up to which all that there is stays stable, plucks, bows and contacts
// as if always felt.
struct Margins {
  double whole = 0.0;        // with the parameters anywhere in the box; below 1: unproved
  double keys = 0.0;         // what keys may use of that: the same with something to spare
  std::vector<Limits> home;  // [parameter] the box, on sides on which limits lie beyond it
  std::vector<double> away;  // the keys' factor at equal steps from the box to the limits
};

// `away` up to where `limits` are; where nothing limits the parameters it does not depend on them.
// No limits: nothing beyond the box. Exact where that is quick, else by the edge bound. O(links)
// then, nine times. [any thread but audio]
Margins find_margins(const Network& network, std::span<const LinkScheme> schemes,
                     const ParameterBox& box, std::span<const Limits> limits, double rate_ratio,
                     const Progress& progress = {});

// The nearest value in six digits that is surely inside the limit.
double inside_limit(double limit, bool is_upper);

}  // namespace ressort::compile
