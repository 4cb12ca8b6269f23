#include "core/analysis/modes/scaling.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <optional>
#include <utility>

#include "core/laws/law.h"
#include "core/model/topology.h"

namespace ressort::analysis {
namespace {

constexpr double decay_60_db = 3.0 * std::numbers::ln10;

using Kind = SpringLine::Kind;

bool is_spring(const Link& link) {
  return facts_of(link.law).is_spring();
}

// Connected components of masses and macros.
class Parts {
 public:
  explicit Parts(const Network& network)
      : network_(network), of_(network.masses.size() + network.macros.size()) {
    std::iota(of_.begin(), of_.end(), std::size_t{0});
    for (const Link& link : network.links) {
      if (holds(link.a) && holds(link.b)) {
        of_[root(node(link.a))] = root(node(link.b));
      }
    }
  }

  std::size_t of_macro(std::size_t macro) { return root(network_.masses.size() + macro); }
  std::size_t of_mass(std::uint32_t mass) { return root(node(mass)); }
  // A mass that never moves belongs to no component, so a link belongs to the component it holds.
  std::size_t of_link(const Link& link) { return of_mass(holds(link.a) ? link.a : link.b); }

 private:
  std::size_t node(std::uint32_t mass) const {
    const Mass& at = network_.masses[mass];
    if (at.kind != MassKind::point) {
      return mass;
    }
    // After macros are expanded, a place is connected to their first node.
    const Tap& tap = network_.taps[at.tap];
    return network_.macros.empty() ? tap.first : network_.masses.size() + tap.macro;
  }
  bool holds(std::uint32_t mass) const {
    return moves(network_.masses[mass]) || network_.masses[mass].kind == MassKind::point;
  }
  std::size_t root(std::size_t i) {
    while (of_[i] != i) {
      i = of_[i] = of_[of_[i]];
    }
    return i;
  }

  const Network& network_;
  std::vector<std::size_t> of_;
};

// Builds new arguments of a network from its existing ones.
class Arguments {
 public:
  explicit Arguments(Network& network) : network_(network) {}

  ArgumentId times(ArgumentId id, double factor) {
    if (id == no_argument || factor == 1.0) {
      return id;
    }
    Formula formula = network_.arguments[id];
    if (is_constant(formula)) {
      return network_.add(evaluate(formula, {}) * factor);
    }
    const std::size_t size = formula.size();
    if (size > 2 && formula[size - 1].op == Op::multiply && formula[size - 2].op == Op::number) {
      // The argument already has a factor from an earlier tuning.
      formula[size - 2].value *= factor;
    } else {
      formula.push_back({.op = Op::number, .value = factor});
      formula.push_back({.op = Op::multiply});
    }
    return network_.add(std::move(formula));
  }

 private:
  Network& network_;
};

}  // namespace

Result<std::vector<SpringLine>> spring_lines(const Network& network, std::string_view part) {
  Parts parts(network);
  std::optional<std::size_t> wanted;
  for (std::uint32_t i = 0; i < network.macros.size(); ++i) {
    if (network.macros[i].name == part) {
      wanted = parts.of_macro(i);
    }
  }
  for (std::uint32_t i = 0; i < network.masses.size(); ++i) {
    if (moves(network.masses[i]) && std::string_view(network.masses[i].name) == part) {
      wanted = parts.of_mass(i);
    }
  }
  for (const Link& link : network.links) {
    if (std::string_view(link.name) == part) {
      wanted = parts.of_link(link);
    }
  }
  if (!part.empty() && !wanted) {
    return Error{"expected the name of a mass, a link, a string or a mesh, found '" +
                 std::string(part) + "'"};
  }
  const auto is_in = [&](std::size_t of) { return part.empty() || of == *wanted; };
  std::vector<SpringLine> lines;
  for (std::uint32_t i = 0; i < network.masses.size(); ++i) {
    if (network.masses[i].kind == MassKind::oscillator && is_in(parts.of_mass(i))) {
      lines.push_back({Kind::mass, i});
    }
  }
  for (std::uint32_t i = 0; i < network.links.size(); ++i) {
    if (is_spring(network.links[i]) && is_in(parts.of_link(network.links[i]))) {
      lines.push_back({Kind::link, i});
    }
  }
  for (std::uint32_t i = 0; i < network.macros.size(); ++i) {
    const Macro& macro = network.macros[i];
    if (is_in(parts.of_macro(i)) && (consists_of_modes(macro.kind) || is_waveguide(macro.kind))) {
      return Error{
          "'" + macro.name + "' gets its frequencies from its own lines; change them there",
          macro.location.line, macro.location.column};
    }
    if (is_in(parts.of_macro(i))) {
      lines.push_back({Kind::macro, i});
    }
  }
  return lines;
}

std::vector<std::size_t> lines_of(const Network& network, const Network& expanded,
                                  const LinearSystem& system,
                                  const std::vector<SpringLine>& lines) {
  std::vector<std::size_t> of_mass(network.masses.size(), lines.size());
  std::vector<std::size_t> of_link(network.links.size(), lines.size());
  std::vector<std::size_t> of_macro(network.macros.size(), lines.size());
  for (std::size_t i = 0; i < lines.size(); ++i) {
    auto& of = lines[i].kind == Kind::mass   ? of_mass
               : lines[i].kind == Kind::link ? of_link
                                             : of_macro;
    of[lines[i].index] = i;
  }
  std::vector<std::size_t> macro_end;  // [macro] One past its last node among the masses.
  std::size_t end = network.masses.size();
  for (const Macro& macro : network.macros) {
    macro_end.push_back(end += node_count(macro));
  }
  const auto at_node = [&](std::size_t mass) {
    const auto macro = std::ranges::upper_bound(macro_end, mass);
    return macro == macro_end.end() ? lines.size()
                                    : of_macro[static_cast<std::size_t>(macro - macro_end.begin())];
  };
  std::vector<std::size_t> of;
  for (const ModalSpring& spring : system.springs) {
    of.push_back(!spring.is_link ? spring.element < of_mass.size() ? of_mass[spring.element]
                                                                   : at_node(spring.element)
                 : spring.element < of_link.size() ? of_link[spring.element]
                                                   : at_node(expanded.links[spring.element].a));
  }
  return of;
}

Network scaled(const Network& network, const std::vector<SpringLine>& lines,
               const std::vector<double>& stiffness, const std::vector<double>& damping) {
  Network out = network;
  Arguments arguments(out);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const double k = stiffness[i];
    const double z = damping[i];
    switch (lines[i].kind) {
      case Kind::mass: {
        Mass& mass = out.masses[lines[i].index];
        mass.stiffness = arguments.times(mass.stiffness, k);
        mass.damping = arguments.times(mass.damping, z);
        break;
      }
      case Kind::macro: {
        Macro& macro = out.macros[lines[i].index];
        macro.stiffness = arguments.times(macro.stiffness, k);
        macro.second_stiffness = arguments.times(macro.second_stiffness, k);
        macro.damping = arguments.times(macro.damping, z);
        macro.air_damping = arguments.times(macro.air_damping, z);
        break;
      }
      case Kind::link: {
        Link& link = out.links[lines[i].index];
        const LawFacts& law = facts_of(link.law);
        for (std::size_t a = 0; a < law.count; ++a) {
          link.arguments[a] =
              arguments.times(link.arguments[a], law.arguments[a].unit == Unit::stiffness ? k
                                                 : law.arguments[a].unit == Unit::damping ? z
                                                                                          : 1.0);
        }
        break;
      }
    }
  }
  return canonical(std::move(out));
}

double DecayLaw::t60_s(double frequency_hz) const {
  return decay_60_db / (a + b * frequency_hz * frequency_hz);
}

Result<DecayLaw> decay_law(const std::vector<DecayPoint>& points) {
  double n = 0.0;
  double sum_x = 0.0;
  double sum_xx = 0.0;
  double sum_y = 0.0;
  double sum_xy = 0.0;
  for (const DecayPoint& point : points) {
    if (!(point.frequency_hz >= 0.0 && std::isfinite(point.frequency_hz) && point.t60_s > 0.0)) {
      return Error{"expected a frequency of 0 or more in Hz, and a T60 above 0 in seconds"};
    }
    const double x = point.frequency_hz * point.frequency_hz;
    const double y = decay_60_db / point.t60_s;
    n += 1.0;
    sum_x += x;
    sum_xx += x * x;
    sum_y += y;
    sum_xy += x * y;
  }
  if (points.empty()) {
    return Error{"expected at least one frequency with its T60"};
  }
  const double spread = n * sum_xx - sum_x * sum_x;
  DecayLaw law{.a = sum_y / n};
  if (spread > 1e-12 * n * sum_xx) {
    law.b = (n * sum_xy - sum_x * sum_y) / spread;
    law.a = (sum_y - law.b * sum_x) / n;
    if (law.b < 0.0) {
      law = {.a = sum_y / n};
    } else if (law.a < 0.0) {
      law = {.b = sum_xy / sum_xx};
    }
  }
  return law;
}

Network with_decay(const Network& network, const DecayLaw& law) {
  constexpr double rate_hz = Network::reference_rate_hz;
  const double by_mass = 2.0 * law.a / rate_hz;
  const double by_stiffness = 2.0 * law.b * rate_hz / (4.0 * std::numbers::pi * std::numbers::pi);
  Network out = network;
  Arguments arguments(out);
  const auto of_both = [&](ArgumentId mass, ArgumentId stiffness) {
    Formula formula = out.arguments[arguments.times(mass, by_mass)];
    if (stiffness == no_argument || by_stiffness == 0.0) {
      return formula;
    }
    const Formula other = out.arguments[arguments.times(stiffness, by_stiffness)];
    formula.insert(formula.end(), other.begin(), other.end());
    formula.push_back({.op = Op::add});
    return is_constant(formula) ? Formula{{.op = Op::number, .value = evaluate(formula, {})}}
                                : formula;
  };
  for (Mass& mass : out.masses) {
    if (mass.kind == MassKind::mass && by_mass > 0.0) {
      mass.kind = MassKind::oscillator;
      mass.stiffness = out.add(0.0);
    }
    if (mass.kind == MassKind::oscillator) {
      mass.damping = out.add(of_both(mass.mass, mass.stiffness));
    }
  }
  for (Macro& macro : out.macros) {
    macro.damping = arguments.times(macro.stiffness, by_stiffness);
    macro.air_damping = by_mass > 0.0 ? arguments.times(macro.mass, by_mass) : no_argument;
  }
  for (Link& link : out.links) {
    if (is_spring(link)) {
      const LawFacts& facts = facts_of(link.law);
      const ArgumentId stiffness = link.arguments[facts.slot(Role::stiffness)];
      link.arguments[facts.slot(Role::damping)] =
          stiffness == no_argument ? out.add(0.0) : arguments.times(stiffness, by_stiffness);
    }
  }
  return canonical(std::move(out));
}

}  // namespace ressort::analysis
