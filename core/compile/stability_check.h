// core/compile: what may be played. Proves the part of a network that is always felt, and narrows
// the parameters' ranges to where it stays proved.
#pragma once

#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/analysis/stability.h"
#include "core/model/network.h"
#include "core/model/preset/preset.h"
#include "core/progress.h"
#include "core/result.h"

namespace ressort {

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

struct StabilityRequest {
  const Network& written;   // to name what is to blame
  const Network& expanded;  // the same without macros
  const Preset& preset;
  double rate_hz = 44100.0;
  double rate_ratio = 1.0;
  bool bare = false;                     // parameters go where `reach` says and nowhere else
  bool is_open = false;                  // whatever comes of it
  const std::vector<Setting>& settings;  // of the bare network's start, instead of its own
  const std::vector<Setting>& reach;     // values that parameters will be given later
  Progress progress = {};
};

struct StabilityCheck {
  Verdict verdict = Verdict::stable;  // of the start, by what is always felt
  std::optional<Error> complaint;     // unless stable: of the model, with its line
  std::vector<Error> narrowed;  // ranges that the preset gives and that are too wide; its lines
  std::vector<Range> limits;    // [parameter] that nothing may leave; infinite where unknown
  bool is_together = false;     // too many parameters for a limit of each: all were narrowed alike
};

// Looks at the start; if that is proved, widens it to the ranges of `parameters` as far as the
// whole of their box is proved, and writes back what it came to. A start that is not proved keeps
// its ranges. O(links) where the edge bound says yes. [any thread but audio]
StabilityCheck check_stability(const StabilityRequest& request,
                               std::vector<ParameterInfo>& parameters);

// The first element, in the order of the network, of which an argument is no finite number with
// these values of the parameters, or which weighs nothing; with its line. What an audio input gives
// is not looked at. [any thread but audio]
std::optional<Error> no_number(const Network& network, std::span<const double> parameters,
                               double rate_ratio);

// The nearest value in six digits that is surely inside the limit.
double inside_limit(double limit, bool is_upper);

}  // namespace ressort
