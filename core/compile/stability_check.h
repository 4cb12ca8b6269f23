// core/compile: the proof of stability. Proves 4M - K - 2Z > 0 for the linear part of a network,
// narrows the parameters' ranges to where the proof holds, and finds the margin left for keys.
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

// Larger networks get their ranges by the edge bound (Gershgorin), because the exact limits take a
// Cholesky factorisation for each trial.
inline constexpr std::size_t most_quick_masses = 256;

// A parameter as the user sees it: its name, its value in its own unit and its range.
struct ParameterInfo {
  std::string name;
  double value = 0.0;  // value at the start
  double minimum = 0.0;
  double maximum = 0.0;
  int audio_input = 0;  // channel that sets it, sample by sample; 0: none
  // Interval in which the linear part is stable, with the other parameters anywhere in their
  // ranges.
  SafeRange safe{-std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
  bool is_raised = false;   // the minimum was raised to keep the network stable
  bool is_lowered = false;  // the maximum was lowered
};

struct Setting {
  std::string parameter;
  double value = 0.0;
};

// Returns the requested ranges: the preset's or, for other parameters, from 0 to four times the
// value. A bare network has no ranges. The preset must fit the network, which has no macros.
std::vector<ParameterInfo> requested_ranges(const Network& network, const Preset& preset,
                                            bool bare);

// Returns the start values; `settings` apply to a bare network only.
std::vector<double> start_values(const std::vector<ParameterInfo>& parameters,
                                 const std::vector<Setting>& settings, bool bare);

// Returns the ranges in the preset, before they are narrowed. Parameters that it does not name stay
// at their values.
ParameterBox preset_box(const std::vector<ParameterInfo>& parameters, const Preset& preset);

struct StabilityRequest {
  const Network& written;   // its elements are named in errors
  const Network& expanded;  // the same network without macros
  const Preset& preset;
  const std::vector<ParameterInfo>& parameters;  // result of requested_ranges()
  std::span<const Scheme> schemes;               // [link] empty: all as published
  std::span<const double> start;                 // [parameter] from start_values()
  double rate_hz = 44100.0;
  double rate_ratio = 1.0;
  bool bare = false;                  // ranges cover the start and `reach` only
  bool is_open = false;               // do not narrow ranges
  const std::vector<Setting>& reach;  // values that parameters will get later
  Progress progress = {};
};

struct StabilityCheck {
  Network proved;  // the written network without passive links: the subject of the proof
  Verdict verdict = Verdict::stable;      // verdict at the start values
  std::optional<Error> complaint;         // unless stable: error at the model's line
  std::vector<ParameterInfo> parameters;  // parameters with the narrowed ranges
  std::vector<Error> narrowed;            // ranges of the preset that are too wide, at its lines
  std::vector<Limits> limits;             // [parameter] enforced limits; infinite: none
  bool is_together = false;               // all ranges were narrowed by the same share
};

// Proves the start values and, if they are stable, extends the proof to the box of all ranges,
// narrowing ranges where it fails. Ranges stay as requested if the start is not proved. O(links) if
// the edge bound suffices. [any thread but audio]
StabilityCheck check_stability(const StabilityRequest& request);

// Returns the preset's ranges, cut to the narrowed ones.
ParameterBox proved_box(const StabilityCheck& check, const Preset& preset);

// Factors on every stiffness up to which the network stays stable. Plucks, bows and contacts count
// as if they were always closed.
struct Margins {
  double whole = 0.0;        // factor with parameters anywhere in the box; below 1: unproved
  double keys = 0.0;         // the share of it that keys may use
  std::vector<Limits> home;  // [parameter] the box, on those sides where a limit lies beyond it
  std::vector<double> away;  // `keys` at equal steps from the box to the limits
};

// Computes the margins, exactly for up to most_quick_masses and otherwise by the edge bound.
// `limits`: empty if no parameter may leave the box. O(links), nine times. [any thread but audio]
Margins find_margins(const Network& network, std::span<const Scheme> schemes,
                     const ParameterBox& box, std::span<const Limits> limits, double rate_ratio,
                     const Progress& progress = {});

// Returns the nearest value in six digits that is certainly within the limit.
double inside_limit(double limit, bool is_upper);

}  // namespace ressort::compile
