// core/analysis/modes: a network with other springs and dampers, written as it was.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
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
  std::uint32_t index = 0;  // into Network::masses, links or macros
  bool operator==(const SpringLine&) const = default;
};

// All lines of a network with springs or dampers, or those that hang together with the mass, macro
// or link of this name. The error says what was expected. O(masses + links)
Result<std::vector<SpringLine>> spring_lines(const Network& network, std::string_view part = "");

// Which of the lines a spring of the system is of, the system being that of the same network with
// its macros written out; [spring], lines.size() for none.
std::vector<std::size_t> lines_of(const Network& network, const Network& expanded,
                                  const LinearSystem& system, const std::vector<SpringLine>& lines);

// Every stiffness and damping of lines[i] times stiffness[i] and damping[i]: numbers are numbers
// again, and formulas get a factor. Plucks, bows and contacts stay. Canonical.
Network scaled(const Network& network, const std::vector<SpringLine>& lines,
               const std::vector<double>& stiffness, const std::vector<double>& damping);

// How fast motions decay: by a + b f^2 each second, so that T60 = 6.91 s / (a + b f^2).
struct DecayLaw {
  double a = 0.0;  // 1/s
  double b = 0.0;  // s
  double t60_s(double frequency_hz) const;
};

struct DecayPoint {
  double frequency_hz = 0.0;
  double t60_s = 0.0;
};

// The law through one or two points, or nearest to more of them in 1/T60; a and b are never below
// 0. The error says what a point lacks.
Result<DecayLaw> decay_law(const std::vector<DecayPoint>& points);

// The network with dampers that make every mode of it decay by the law, whatever its shape: each
// spring gets Z in proportion to its K, each mass a damper to 0 in proportion to its M, instead of
// those that were there. Exact for the continuous network; the published scheme is off where f
// comes near the rate. A stiffString's second springs cannot be damped: there b counts for the
// first ones alone. Plucks, bows and contacts stay. Canonical.
Network with_decay(const Network& network, const DecayLaw& law);

}  // namespace ressort::analysis
