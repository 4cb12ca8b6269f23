// core/compile: the stage that finds start values, ranges and the lowest mode of a network.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "core/analysis/interval.h"
#include "core/analysis/linear.h"
#include "core/compile/options.h"
#include "core/compile/stability_check.h"
#include "core/result.h"

namespace ressort::compile {

// Keys do not set the pitch of a larger network: finding its lowest mode would take too long.
inline constexpr std::size_t most_tuned_masses = 150'000;

struct Analysis {
  std::vector<ParameterInfo> requested;  // [parameter] the ranges that the preset asks for
  std::vector<double> values;            // [parameter] value in the preset, or in the model
  std::vector<double> start;             // [parameter] the same with CompileOptions::settings
  std::optional<LowestShapes> shapes;    // lowest mode, if keys set the pitch

  std::optional<Mode> mode() const { return shapes ? std::optional(shapes->mode) : std::nullopt; }
};

// Fails with the model's line if an argument is not finite at the start values, or if a waveguide
// is too high or too low for the sample rate. [any thread but audio]
Result<Analysis> analyse(const CompileRequest& request, const Network& network);

// Returns the lowest mode, or the mode that the preset names, at these values of the parameters. A
// waveguide counts as a mode without damping, which all of the stiffness tunes. Nothing without a
// keyboard, without such a mode and for more than most_tuned_masses.
std::optional<LowestShapes> find_shapes(const CompileRequest& request, const Network& network,
                                        std::span<const double> parameters);

// Returns the largest factor on every stiffness, and so on the square of the frequency, at which
// every waveguide is long enough for its places, anywhere in the box. Infinite without waveguides.
double highest_waveguide_factor(const Network& network, const ParameterBox& box, double rate_hz);

}  // namespace ressort::compile
