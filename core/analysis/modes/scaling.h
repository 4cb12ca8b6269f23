// core/analysis/modes: scales the springs and dampers of a network and keeps the form in which it
// was written.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "core/analysis/modes/linear_system.h"
#include "core/model/network.h"
#include "core/result.h"

namespace ressort::analysis {

// One line of a model that has springs or dampers.
struct SpringLine {
  enum class Kind : std::uint8_t { mass, link, macro };
  Kind kind = Kind::link;
  std::uint32_t index = 0;  // Index into Network::masses, links or macros.
  bool operator==(const SpringLine&) const = default;
};

// Returns all lines with springs or dampers, or those connected to the mass, macro or link with
// this name. The error names what was expected. O(masses + links)
Result<std::vector<SpringLine>> spring_lines(const Network& network, std::string_view part = "");

// Returns for each spring of the system the index of its line; lines.size() for none. The system is
// that of the same network with macros expanded.
std::vector<std::size_t> lines_of(const Network& network, const Network& expanded,
                                  const LinearSystem& system, const std::vector<SpringLine>& lines);

// Multiplies the stiffness and damping of lines[i] by stiffness[i] and damping[i]. Numbers stay
// numbers, formulas get a factor. Plucks, bows and contacts are unchanged. Canonical.
Network scaled(const Network& network, const std::vector<SpringLine>& lines,
               const std::vector<double>& stiffness, const std::vector<double>& damping);

// A decay rate of a + b f^2 per second, so that T60 = 6.91 s / (a + b f^2).
struct DecayLaw {
  double a = 0.0;  // 1/s
  double b = 0.0;  // s
  double t60_s(double frequency_hz) const;
};

struct DecayPoint {
  double frequency_hz = 0.0;
  double t60_s = 0.0;
};

// Fits the law through one or two points, or to more points in 1/T60; a and b are never below 0.
// The error names what a point lacks.
Result<DecayLaw> decay_law(const std::vector<DecayPoint>& points);

// Returns the network with dampers that make every mode decay by the law (Rayleigh damping): each
// spring gets a Z proportional to its K, each mass a damper to 0 proportional to its M; existing
// dampers are replaced. Exact for the continuous network; the published scheme deviates when f
// approaches the rate. The second springs of a stiffString cannot be damped, so b applies to its
// first springs only. Plucks, bows and contacts are unchanged. Canonical.
Network with_decay(const Network& network, const DecayLaw& law);

}  // namespace ressort::analysis
