#include "core/compile/analyse.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "core/analysis/assembly.h"
#include "core/kernels/waveguides/rails.h"
#include "core/model/language/expression.h"
#include "core/model/number_check.h"

namespace ressort::compile {
namespace {

// Returns the highest frequency of each waveguide, in Hz: a period must have room for its places.
std::vector<double> highest_frequencies(const Network& network, double rate_hz) {
  std::vector<std::uint32_t> places(network.waveguides.size(), 0);
  for (const Mass& mass : network.masses) {
    if (mass.kind == MassKind::junction) {
      ++places[network.taps[mass.tap].macro];
    }
  }
  std::vector<double> highest;
  for (const std::uint32_t count : places) {
    highest.push_back(highest_waveguide_hz(least_waveguide_samples(count), rate_hz));
  }
  return highest;
}

// Returns the lowest partial of the lowest waveguide as a mode whose stiffness is the square of
// its angle per sample. With Stepping::Scheme::exact the factor of a key is then exact.
std::optional<LowestShapes> waveguide_shapes(const Network& network,
                                             std::span<const double> parameters) {
  double hz = std::numeric_limits<double>::infinity();
  for (const Macro& guide : network.waveguides) {
    const double own = argument_value(network, guide.frequency_hz, parameters);
    hz = guide.is_fixed ? hz : std::min(hz, own);
  }
  if (!std::isfinite(hz)) {
    return std::nullopt;
  }
  const double angle = 2.0 * std::numbers::pi * hz / Network::reference_rate_hz;
  LowestShapes shapes{
      {.stiffness = angle * angle, .damping = 0.0, .frequency_hz = hz}, Matrix(1, 1), Matrix(1, 1)};
  shapes.stiffness(0, 0) = angle * angle;
  return shapes;
}

// Returns an error at the first waveguide whose frequency or T60 is impossible at this rate.
std::optional<Error> find_impossible_waveguide(const Network& network,
                                               std::span<const double> parameters, double rate_hz) {
  const std::vector<double> highest = highest_frequencies(network, rate_hz);
  for (std::size_t i = 0; i < highest.size(); ++i) {
    const Macro& guide = network.waveguides[i];
    const double hz = argument_value(network, guide.frequency_hz, parameters);
    const auto error_at = [&](const std::string& message) {
      return Error{message, guide.location.line, guide.location.column};
    };
    if (!(hz <= highest[i])) {
      return error_at(
          "the frequency " + print_number(hz) + " Hz of the waveguide '" + guide.name +
          "' is too high: with this number of places the limit at this sample rate is " +
          print_number(std::floor(highest[i])) + " Hz");
    }
    if (!(hz >= lowest_waveguide_hz)) {
      return error_at("the frequency " + print_number(hz) + " Hz of the waveguide '" + guide.name +
                      "' is too low: the limit is " + print_number(lowest_waveguide_hz) + " Hz");
    }
    if (!(argument_value(network, guide.t60_s, parameters) > 0.0)) {
      return error_at("the T60 of the waveguide '" + guide.name + "' must be above 0 s");
    }
  }
  return std::nullopt;
}

}  // namespace

std::optional<LowestShapes> find_shapes(const CompileRequest& request, const Network& network,
                                        std::span<const double> parameters) {
  if (!request.preset.keyboard || moving_count(network) > most_tuned_masses) {
    return std::nullopt;
  }
  request.options.progress.stage("finding its lowest mode");
  if (!network.waveguides.empty()) {
    return waveguide_shapes(network, parameters);
  }
  return lowest_shapes(network, parameters, request.options.progress);
}

Result<Analysis> analyse(const CompileRequest& request, const Network& network) {
  const CompileOptions& options = request.options;
  Analysis analysis{.requested = requested_ranges(network, request.preset, options.bare)};
  analysis.values = start_values(analysis.requested, {}, options.bare);
  analysis.start = start_values(analysis.requested, options.settings, options.bare);
  if (auto error = find_invalid_number(request.written, analysis.start, request.rate_ratio)) {
    return *std::move(error);
  }
  if (auto error = find_impossible_waveguide(network, analysis.start, options.rate_hz)) {
    return *std::move(error);
  }
  analysis.shapes = find_shapes(request, network, analysis.values);
  return analysis;
}

double highest_waveguide_factor(const Network& network, const ParameterBox& box, double rate_hz) {
  double factor = std::numeric_limits<double>::infinity();
  if (network.waveguides.empty()) {
    return factor;
  }
  const std::vector<double> highest = highest_frequencies(network, rate_hz);
  const std::vector<Range> arguments = argument_ranges(network, box);
  for (std::size_t i = 0; i < highest.size(); ++i) {
    if (network.waveguides[i].is_fixed) {
      continue;
    }
    const double hz = range_at(arguments, network.waveguides[i].frequency_hz).highest;
    factor = std::min(factor, (highest[i] / hz) * (highest[i] / hz));
  }
  return factor;
}

}  // namespace ressort::compile
