#include "core/compile/schemes.h"

#include <algorithm>

#include "core/analysis/stability.h"
#include "core/laws/law.h"
#include "core/model/topology.h"

namespace ressort::compile {
namespace {

// Returns how the published law may fail.
std::string_view hazard_of(const LawFacts& law) {
  return law.is_friction      ? "stick one sample too late"
         : law.is_spring()    ? "become unstable at large amplitudes"
         : law.is_one_sided() ? "gain energy at each contact"
                              : "gain energy on release";
}

std::string counted(const LawFacts& law, std::size_t count) {
  return std::to_string(count) + " " + std::string(count == 1 ? law.one : law.many);
}

// Returns the first law with this name. Bows of all profiles count as bows.
std::size_t first_with_name(std::string_view one) {
  std::size_t i = 0;
  while (law_table()[i].one != one) {
    ++i;
  }
  return i;
}

// Returns whether all stiffnesses and dampings are the constant 0.
bool exerts_nothing(const Network& network, const Link& link) {
  const LawFacts& law = facts_of(link.law);
  for (std::size_t i = 0; i < law.count; ++i) {
    const ArgumentId argument = link.arguments[i];
    if (!law.is_strength(i) || argument == no_argument) {
      continue;
    }
    const Formula& formula = network.arguments[argument];
    if (formula.size() != 1 || formula[0].op != Op::number || formula[0].value != 0.0) {
      return false;
    }
  }
  return true;
}

}  // namespace

Schemes choose_schemes(const Network& network, const Budget& budget, const Progress& progress) {
  Schemes schemes;
  schemes.links.resize(network.links.size());
  std::vector<std::size_t> counts(
      law_table().size());  // [law] links that are not linear, by their name
  const Link* first = nullptr;
  progress.spend(network.links.size());
  for (std::size_t i = 0; i < network.links.size(); ++i) {
    const Link& link = network.links[i];
    const auto is_junction = [&](std::uint32_t mass) {
      return network.masses[mass].kind == MassKind::junction;
    };
    if (exerts_nothing(network, link)) {
      continue;
    }
    if (is_junction(link.a) || is_junction(link.b)) {
      schemes.links[i] = Scheme::discrete_gradient;
      continue;
    }
    if (is_linear(link.law)) {
      continue;
    }
    first = first == nullptr ? &link : first;
    ++counts[first_with_name(facts_of(link.law).one)];
    if (budget.passive == Passivity::always) {
      schemes.links[i] = Scheme::discrete_gradient;
    }
  }
  std::string all;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    const LawFacts& law = law_table()[i];
    const std::string who = counts[i] > 0 ? counted(law, counts[i]) : "";
    if (counts[i] > 0 && budget.passive == Passivity::always) {
      schemes.notes.push_back(who + " made passive: as published " +
                              (counts[i] == 1 ? "it could " : "they could ") +
                              std::string(hazard_of(law)));
    }
    all += counts[i] > 0 ? (all.empty() ? "" : ", ") + who : "";
  }
  if (first != nullptr && budget.passive == Passivity::never) {
    schemes.hazard = Error{
        "played as published: " + all + " may gain energy. Use --budget passive=auto to prevent it",
        first->location.line, first->location.column};
  }
  return schemes;
}

Network without_passive(const Network& network, std::span<const Scheme> schemes) {
  const auto is_plain = [](Scheme scheme) { return scheme == Scheme::plain; };
  if (std::ranges::all_of(schemes, is_plain)) {
    return network;
  }
  const std::vector<double> values = parameter_values(network);
  std::size_t i = 0;  // links of macros come last and are plain
  Network felt = network;
  std::erase_if(felt.links, [&](const Link& link) {
    const LawFacts& law = facts_of(link.law);
    // Quadratic and cubic springs count with their linear K and Z, links on a waveguide if these
    // may be negative.
    const bool counts = i >= schemes.size() || is_plain(schemes[i]) ||
                        (law.contains_spring && law.is_curved) || pushes(network, link, values) ||
                        is_on_waveguide(network, link.a) || is_on_waveguide(network, link.b);
    ++i;
    return !counts;
  });
  return felt;
}

}  // namespace ressort::compile
