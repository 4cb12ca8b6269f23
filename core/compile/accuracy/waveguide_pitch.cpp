#include "core/compile/accuracy/waveguide_pitch.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "core/analysis/assembly.h"
#include "core/kernels/waveguides/rails.h"
#include "core/model/language/expression.h"

namespace ressort::compile {
namespace {

// [waveguide] how high it may be.
std::vector<double> highest_of(const Network& network, double rate_hz) {
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

}  // namespace

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

std::optional<Error> waveguide_too_high(const Network& network, std::span<const double> parameters,
                                        double rate_hz) {
  const std::vector<double> highest = highest_of(network, rate_hz);
  for (std::size_t i = 0; i < highest.size(); ++i) {
    const Macro& guide = network.waveguides[i];
    const double hz = argument_value(network, guide.frequency_hz, parameters);
    if (!(hz <= highest[i])) {
      return Error{"the waveguide '" + guide.name + "' is to sound at " + print_number(hz) +
                       " Hz: with so many places on it, at most " +
                       print_number(std::floor(highest[i])) + " Hz have room at this sample rate",
                   guide.location.line, guide.location.column};
    }
    if (!(hz >= lowest_waveguide_hz)) {
      return Error{"the waveguide '" + guide.name + "' is to sound at " + print_number(hz) +
                       " Hz, but " + print_number(lowest_waveguide_hz) + " Hz is the lowest",
                   guide.location.line, guide.location.column};
    }
    if (!(argument_value(network, guide.t60_s, parameters) > 0.0)) {
      return Error{"the T60 of the waveguide '" + guide.name + "' must be above 0 s",
                   guide.location.line, guide.location.column};
    }
  }
  return std::nullopt;
}

double highest_waveguide_factor(const Network& network, const ParameterBox& box, double rate_hz) {
  double factor = std::numeric_limits<double>::infinity();
  if (network.waveguides.empty()) {
    return factor;
  }
  const std::vector<double> highest = highest_of(network, rate_hz);
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
