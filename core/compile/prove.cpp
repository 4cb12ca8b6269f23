#include "core/compile/prove.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/analysis/compliance.h"

namespace ressort::compile {
namespace {

constexpr std::size_t most_places = 64;  // Each place takes a solution of the linear system.

}  // namespace

std::vector<std::optional<RestBound>> make_rest_bounds(const Network& network,
                                                       const Machine& machine,
                                                       const ParameterBox& box,
                                                       const Progress& progress) {
  std::vector<std::optional<RestBound>> bounds(machine.parts.size());
  std::map<std::uint32_t, double> compliance_of;  // keyed by mass
  for (const Output& output : network.outputs) {
    compliance_of[output.mass] = 0.0;
  }
  for (const Link& link : network.links) {
    if (facts_of(link.law).can_detach()) {
      compliance_of[link.a] = compliance_of[link.b] = 0.0;
    }
  }
  std::vector<std::uint32_t> masses;
  for (const auto& [mass, compliance] : compliance_of) {
    masses.push_back(mass);
  }
  if (masses.size() > most_places) {
    return bounds;
  }
  const auto found = compliances(network, box, machine.rate_ratio, masses, progress);
  if (!found) {
    return bounds;
  }
  for (std::size_t i = 0; i < masses.size(); ++i) {
    compliance_of[masses[i]] = (*found)[i];
  }
  std::vector<Limits> limits;
  for (std::size_t i = 0; i < box.lowest.size(); ++i) {
    limits.push_back({box.lowest[i], box.highest[i]});
  }
  for (std::size_t p = 0; p < bounds.size(); ++p) {
    const Program& program = machine.parts[p];
    RestBound bound{.compliances = {}, .reaches = {}, .box = limits};
    bool is_known = true;
    for (const OutputSlot& slot : program.outputs) {
      const Output& output = network.outputs[slot.origin];
      const double level = level_value(network, output, machine.parameters);
      // A difference of two positions is at most twice the larger one.
      const double swing = level * std::pow(2.0 / machine.rate_ratio, output.derivative);
      const double compliance = compliance_of[output.mass] * swing * swing;
      const bool is_level_fixed =
          output.level == no_argument || is_constant(network.arguments[output.level]);
      is_known = is_known && is_level_fixed && !slot.is_force && std::isfinite(compliance);
      bound.compliances.push_back(compliance);
    }
    for (std::uint32_t i = 0; i < program.origins.size(); ++i) {
      const Link& link = network.links[program.origins[i]];
      if (facts_of(link.law).can_detach()) {
        const double root = std::sqrt(compliance_of[link.a]) + std::sqrt(compliance_of[link.b]);
        bound.reaches.push_back({i, root * root});
      }
    }
    if (is_known) {
      bounds[p] = std::move(bound);
    }
  }
  return bounds;
}

Proof prove(const CompileRequest& request, const Reduced& reduced, const Analysis& analysis,
            const Schemes& schemes, const Machine& machine) {
  const CompileOptions& options = request.options;
  const Network& network = reduced.network;
  options.progress.stage("proving that it is stable");
  StabilityCheck stability =
      check_stability({.written = reduced.merged_springs == 0 ? request.written : network,
                       .expanded = network,
                       .preset = request.preset,
                       .parameters = analysis.requested,
                       .schemes = schemes.links,
                       .start = analysis.start,
                       .rate_hz = options.rate_hz,
                       .rate_ratio = request.rate_ratio,
                       .bare = options.bare,
                       .is_open = options.force,
                       .reach = options.reach,
                       .progress = options.progress});
  const ParameterBox box = proved_box(stability, request.preset);
  Margins margins = find_margins(network, schemes.links, box,
                                 options.bare ? std::span<const Limits>() : stability.limits,
                                 request.rate_ratio, options.progress);
  margins.keys = std::min(margins.keys, highest_waveguide_factor(network, box, options.rate_hz));
  for (double& factor : margins.away) {
    factor = std::min(factor, margins.keys);
  }
  auto rest_bounds = !options.bare && margins.keys >= 1.0 && network.waveguides.empty()
                         ? make_rest_bounds(network, machine, box, options.progress)
                         : std::vector<std::optional<RestBound>>();
  return {std::move(stability), std::move(margins), std::move(rest_bounds)};
}

}  // namespace ressort::compile
