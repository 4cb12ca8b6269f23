#include "core/compile/rest_bound.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/analysis/compliance.h"

namespace ressort::compile {
namespace {

constexpr std::size_t most_places = 64;  // each takes a solution

}  // namespace

std::vector<std::optional<RestBound>> make_rest_bounds(const Network& network,
                                                       const Machine& machine,
                                                       const ParameterBox& box,
                                                       const Progress& progress) {
  std::vector<std::optional<RestBound>> bounds(machine.parts.size());
  std::map<std::uint32_t, double> given;  // mass -> its compliance
  for (const Output& output : network.outputs) {
    given[output.mass] = 0.0;
  }
  for (const Link& link : network.links) {
    if (facts_of(link.law).lets_go()) {
      given[link.a] = given[link.b] = 0.0;
    }
  }
  std::vector<std::uint32_t> masses;
  for (const auto& [mass, compliance] : given) {
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
    given[masses[i]] = (*found)[i];
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
      const double compliance = given[output.mass] * level * level;
      const bool is_level_fixed =
          output.level == no_argument || is_constant(network.arguments[output.level]);
      is_known = is_known && is_level_fixed && !slot.is_force && std::isfinite(compliance);
      bound.compliances.push_back(compliance);
    }
    for (std::uint32_t i = 0; i < program.origins.size(); ++i) {
      const Link& link = network.links[program.origins[i]];
      if (facts_of(link.law).lets_go()) {
        const double root = std::sqrt(given[link.a]) + std::sqrt(given[link.b]);
        bound.reaches.push_back({i, root * root});
      }
    }
    if (is_known) {
      bounds[p] = std::move(bound);
    }
  }
  return bounds;
}

}  // namespace ressort::compile
