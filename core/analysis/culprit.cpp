// Finds the element that makes a network unstable, and words the message.
#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "core/analysis/stability.h"
#include "core/model/language/expression.h"
#include "core/ranges.h"

namespace ressort::analysis {
namespace {

// Returns the argument slot of a link's stiffness or damping. Of two stiffnesses, the larger one or
// the negative one.
std::size_t slot_of(const Link& link, Quantity quantity, bool gains_energy,
                    std::span<const Range> arguments) {
  const LawFacts& law = facts_of(link.law);
  if (quantity != Quantity::stiffness || !law.has(Role::stiffness)) {
    return law.slot(Role::damping);
  }
  const auto range = [&](Role role) { return range_at(arguments, link.arguments[law.slot(role)]); };
  const bool is_limit =
      law.has(Role::limit) &&
      (gains_energy ? range(Role::limit).lowest < 0.0
                    : !(range(Role::stiffness).highest > range(Role::limit).highest));
  return law.slot(is_limit ? Role::limit : Role::stiffness);
}

// Returns for example "the stiffness m_K = 5 of 'r1' and 2 more".
std::string described(const Culprit& culprit) {
  const std::string number = print_number(culprit.value);
  std::string text = std::string("the ") + quantity_name(culprit.quantity) + " " + culprit.argument;
  if (culprit.argument != number) {
    text += " = " + number;
  }
  text += culprit.name.empty() ? "" : " of '" + culprit.name + "'";
  return culprit.others == 0 ? text : text + " and " + std::to_string(culprit.others) + " more";
}

}  // namespace

// Finds a mass that is not above 0, or an argument that is not finite.
std::optional<Stability::Suspect> Stability::find_invalid_number_in(
    std::span<const Range> arguments) {
  for (std::size_t row = 0; row < assembly_.masses.size(); ++row) {
    const Range mass = range_at(arguments, network_.masses[assembly_.masses[row]].mass);
    if (!(mass.lowest > 0.0 && std::isfinite(mass.highest))) {
      return Suspect{Quantity::mass, row};
    }
  }
  const std::span<const Load> all = loads(arguments);
  for (std::size_t t = 0; t < all.size(); ++t) {
    if (!std::isfinite(all[t].total())) {
      const bool is_stiff = !std::isfinite(all[t].stiff);
      return Suspect{is_stiff ? Quantity::stiffness : Quantity::damping, t};
    }
  }
  return std::nullopt;
}

Stability::Suspect Stability::feeder(std::span<const Range> arguments) {
  const std::span<const Load> all = lowest_loads(arguments);
  const auto least = std::ranges::min_element(all, [](const Load& a, const Load& b) {
    return std::min(a.stiff, a.damped) < std::min(b.stiff, b.damped);
  });
  return {least->stiff < least->damped ? Quantity::stiffness : Quantity::damping,
          static_cast<std::size_t>(least - all.begin()), true};
}

Stability::Suspect Stability::heavier_part(std::size_t term,
                                           std::span<const Range> arguments) const {
  const Load load = highest_load(network_, assembly_.terms[term], arguments, rate_ratio_);
  return {load.stiff >= load.damped + load.rubbed ? Quantity::stiffness : Quantity::damping, term};
}

// Finds the link with the most energy in the unstable motion.
Stability::Suspect Stability::find_worst_link(const Weights& weights,
                                              std::span<const Range> arguments,
                                              std::span<const double> shape) const {
  if (shape.empty()) {
    return heavier_part(edge_bound(assembly_, weights).term, arguments);
  }
  std::vector<double> pull;
  for (std::size_t t = 0; t < assembly_.terms.size(); ++t) {
    double stretch = 0.0;
    for (const Assembly::Entry& entry : assembly_.of(assembly_.terms[t])) {
      stretch += entry.share * shape[entry.row];
    }
    pull.push_back(weights.terms[t] * stretch * stretch);
  }
  return heavier_part(static_cast<std::size_t>(std::ranges::max_element(pull) - pull.begin()),
                      arguments);
}

// Finds a mass that moves almost alone: it may be too light for its links together.
std::optional<Stability::Suspect> Stability::find_lightest_mass(
    const Weights& weights, std::span<const double> shape) const {
  std::vector<double> inertia;
  for (std::size_t i = 0; i < shape.size(); ++i) {
    inertia.push_back(weights.masses[i] * shape[i] * shape[i]);
  }
  const auto most = std::ranges::max_element(inertia);
  if (most == inertia.end() || *most < 0.5 * std::accumulate(inertia.begin(), inertia.end(), 0.0)) {
    return std::nullopt;
  }
  return Suspect{Quantity::mass, static_cast<std::size_t>(most - inertia.begin())};
}

ArgumentId Stability::argument_of(const Suspect& suspect, std::span<const Range> arguments) const {
  if (suspect.quantity == Quantity::mass) {
    return network_.masses[assembly_.masses[suspect.index]].mass;
  }
  const Assembly::Term& term = assembly_.terms[suspect.index];
  if (term.is_link) {
    const Link& link = network_.links[term.element];
    return link.arguments[slot_of(link, suspect.quantity, suspect.gains_energy, arguments)];
  }
  const Mass& mass = network_.masses[term.element];
  return suspect.quantity == Quantity::stiffness ? mass.stiffness : mass.damping;
}

const SourceLocation& Stability::location_of(const Suspect& suspect) const {
  if (suspect.quantity == Quantity::mass) {
    return network_.masses[assembly_.masses[suspect.index]].location;
  }
  const Assembly::Term& term = assembly_.terms[suspect.index];
  return term.is_link ? network_.links[term.element].location
                      : network_.masses[term.element].location;
}

Culprit Stability::accuse(const Suspect& suspect, std::span<const Range> arguments) const {
  Culprit culprit;
  culprit.quantity = suspect.quantity;
  culprit.location = location_of(suspect);
  if (suspect.quantity == Quantity::mass) {
    culprit.name = network_.masses[assembly_.masses[suspect.index]].name;
  } else {
    const Assembly::Term& term = assembly_.terms[suspect.index];
    culprit.name =
        term.is_link ? network_.links[term.element].name : network_.masses[term.element].name;
  }
  for (const Macro& macro : macros_) {
    const bool is_it = macro.location.line == culprit.location.line &&
                       macro.location.column == culprit.location.column;
    culprit.name = is_it && culprit.name.empty() ? macro.name : culprit.name;
  }
  const ArgumentId argument = argument_of(suspect, arguments);
  if (argument != no_argument) {
    const auto names = mapped(network_.parameters, &Parameter::name);
    culprit.argument = print_expression(network_.arguments[argument], names);
    const Range range = arguments[argument];
    const bool is_lowest =
        suspect.quantity == Quantity::mass || suspect.gains_energy || range.highest <= 0.0;
    culprit.value = is_lowest ? range.lowest : range.highest;
  }
  culprit.others = users(suspect, arguments) - 1;
  return culprit;
}

// Returns the number of elements whose quantity is written with the same argument; a macro counts
// as one.
std::size_t Stability::users(const Suspect& suspect, std::span<const Range> arguments) const {
  const ArgumentId argument = argument_of(suspect, arguments);
  const std::size_t count =
      suspect.quantity == Quantity::mass ? assembly_.masses.size() : assembly_.terms.size();
  std::set<std::pair<int, int>> places;
  for (std::size_t i = 0; i < count; ++i) {
    const Suspect other{suspect.quantity, i, suspect.gains_energy};
    if (argument_of(other, arguments) == argument) {
      places.insert({location_of(other).line, location_of(other).column});
    }
  }
  return places.size();
}

// Returns how far one argument may go with all others unchanged.
std::optional<double> Stability::limit(const Suspect& suspect, std::span<const Range> arguments) {
  const ArgumentId argument = argument_of(suspect, arguments);
  if (argument == no_argument) {
    return std::nullopt;
  }
  const auto line = [&](double value) {
    return weights_for(arguments, {suspect.quantity, argument, value});
  };
  if (suspect.quantity != Quantity::mass) {
    if (!boundary_.holds(line(0.0), 4.0)) {
      return std::nullopt;
    }
    // Starts well below the largest double, where bisection would take too many steps.
    double bad = arguments[argument].highest;
    while (bad > 1e6 && !boundary_.holds(line(std::sqrt(bad)), 4.0)) {
      bad = std::sqrt(bad);
    }
    return boundary_.between(line, 0.0, bad).value;
  }
  const double lightest = arguments[argument].lowest;
  for (double factor = 16.0; factor < 1e12; factor *= 16.0) {
    if (boundary_.holds(line(factor * lightest), 4.0)) {
      return boundary_.between(line, factor * lightest, lightest).value;
    }
  }
  return std::nullopt;
}

const char* quantity_name(Quantity quantity) {
  constexpr const char* names[] = {"mass", "stiffness", "damping"};
  return names[static_cast<std::size_t>(quantity)];
}

std::string print_limit(double value, bool is_upper) {
  if (value == 0.0 || !std::isfinite(value)) {
    return value == 0.0 ? "0" : value < 0.0 ? "-inf" : "inf";
  }
  constexpr double found_to = 1e-12;
  const double unit = std::pow(10.0, std::floor(std::log10(std::fabs(value))) - 5.0);
  const double units = value / unit;
  const double slack = found_to * std::fabs(units);
  const double safe = is_upper ? std::floor(units + slack) : std::ceil(units - slack);
  return print_number(unit < 1.0 ? safe / std::round(1.0 / unit) : safe * unit);
}

std::string describe(const SafeRange& safe) {
  const bool has_lowest = safe.lowest != 0.0 && std::isfinite(safe.lowest);
  const bool has_highest = safe.highest != 0.0 && std::isfinite(safe.highest);
  const std::string lowest = print_limit(safe.lowest, false);
  const std::string highest = print_limit(safe.highest, true);
  return has_lowest && has_highest ? "stable between " + lowest + " and " + highest
         : has_lowest              ? "stable above " + lowest
         : has_highest             ? "stable below " + highest
                                   : "stable anywhere";
}

Error complaint(const Certificate& certificate) {
  if (!certificate.culprit) {
    return {certificate.verdict == Verdict::stable ? "stable" : "not proved stable", 0, 0};
  }
  const Culprit& culprit = *certificate.culprit;
  const bool is_mass = culprit.quantity == Quantity::mass;
  std::string text = certificate.verdict == Verdict::unproved ? "may be unstable: " : "unstable: ";
  text += described(culprit);
  if (culprit.limit) {
    text += is_mass ? " must stay above " : " must stay below ";
    text += print_limit(*culprit.limit, !is_mass);
  } else if (certificate.factor > 0.0) {
    text += is_mass ? " is too small" : " is too large";
    text += ", but no value of it alone is enough: reduce all stiffness and damping to " +
            print_limit(certificate.factor, true) + " of their values";
  } else if (!std::isfinite(culprit.value)) {
    text += " is not finite";
  } else if (is_mass || culprit.value < 0.0) {
    text += is_mass ? " must be above 0" : " is negative, so motion can grow without end";
  } else {
    text += " is too large for the analysis";
  }
  return {std::move(text), culprit.location.line, culprit.location.column};
}

}  // namespace ressort::analysis
