#include "core/model/topology.h"

#include <algorithm>
#include <map>
#include <numbers>
#include <tuple>
#include <utility>

#include "core/laws/law.h"

namespace ressort::model {
namespace {

constexpr std::uint32_t nodes_at_once = 4096;  // nodes between two checks for cancellation

// Appends the masses of one macro.
void add_nodes(const Macro& macro, const Progress& progress, Network& network) {
  const auto count = static_cast<std::uint32_t>(node_count(macro));
  for (std::uint32_t k = 0; k < count; ++k) {
    progress.spend(k % nodes_at_once == 0 ? 4 * std::size_t{nodes_at_once} : 0);
    Mass node{.position = macro.position,
              .third = macro.third,
              .is_fixed = macro.is_fixed,
              .location = macro.location};
    if (is_fixed(macro, k)) {
      node.kind = MassKind::ground;
    } else {
      node.mass = macro.mass;
      if (macro.air_damping != no_argument) {
        node.kind = MassKind::oscillator;
        node.damping = macro.air_damping;
      }
    }
    network.masses.push_back(std::move(node));
  }
}

// Appends the links of one macro, whose first node is mass `first`.
void add_links(const Macro& macro, std::uint32_t first, const Progress& progress,
               Network& network) {
  const auto count = static_cast<std::uint32_t>(node_count(macro));
  const auto join = [&](std::uint32_t a, std::uint32_t b, ArgumentId stiffness,
                        ArgumentId damping) {
    if (b < count) {
      Link link{
          .a = first + a, .b = first + b, .is_fixed = macro.is_fixed, .location = macro.location};
      link.arguments[0] = stiffness;
      link.arguments[1] = damping;
      network.links.push_back(std::move(link));
    }
  };
  const auto each_node = [&](auto&& use) {
    for (std::uint32_t k = 0; k < count; ++k) {
      progress.spend(k % nodes_at_once == 0 ? 4 * std::size_t{nodes_at_once} : 0);
      use(k);
    }
  };
  if (macro.width > 1) {
    each_node([&](std::uint32_t k) {
      if (k % macro.width + 1 < macro.width) {
        join(k, k + 1, macro.stiffness, macro.damping);
      }
    });
  }
  each_node([&](std::uint32_t k) { join(k, k + macro.width, macro.stiffness, macro.damping); });
  if (macro.kind == MacroKind::stiff_string) {
    each_node([&](std::uint32_t k) { join(k, k + 2, macro.second_stiffness, no_argument); });
    join(0, 1, macro.second_stiffness, no_argument);
    join(macro.length - 2, macro.length - 1, macro.second_stiffness, no_argument);
  }
}

void append(Formula& formula, const Formula& part) {
  formula.insert(formula.end(), part.begin(), part.end());
}

// Returns M ((2 pi f)^2 + (ln 1000 / T60)^2), per sample.
Formula mode_stiffness(const Formula& mass, const Formula& frequency_hz, const Formula& t60_s) {
  constexpr double turn = 2.0 * std::numbers::pi / Network::reference_rate_hz;
  constexpr double decay = 3.0 * std::numbers::ln10 / Network::reference_rate_hz;
  Formula formula = mass;
  append(formula, frequency_hz);
  append(formula, {{Op::number, 0, turn}, {Op::multiply}, {Op::number, 0, 2.0}, {Op::power}});
  append(formula, {{Op::number, 0, decay}});
  append(formula, t60_s);
  append(formula, {{Op::divide}, {Op::number, 0, 2.0}, {Op::power}, {Op::add}, {Op::multiply}});
  return folded(std::move(formula));
}

// Returns 2 M ln 1000 / T60, per sample.
Formula mode_damping(const Formula& mass, const Formula& t60_s) {
  Formula formula = mass;
  append(formula, {{Op::number, 0, 6.0 * std::numbers::ln10 / Network::reference_rate_hz}});
  append(formula, t60_s);
  append(formula, {{Op::divide}, {Op::multiply}});
  return folded(std::move(formula));
}

// Appends a body's modes as oscillators, and its mode shapes.
void add_modes(const Network& network, std::uint32_t body, const Progress& progress,
               Network& expanded) {
  const Macro& macro = network.macros[body];
  const auto first = expanded.shapes.size();
  expanded.shapes.resize(first + macro.places.size() * macro.length);
  const auto of_body = std::equal_range(network.modes.begin(), network.modes.end(),
                                        BodyMode{.macro = body}, by_body);
  std::size_t at = 0;
  for (auto mode = of_body.first; mode != of_body.second; ++mode) {
    progress.spend(16);
    const auto add = [&](Formula formula) {
      expanded.arguments.push_back(std::move(formula));
      return static_cast<ArgumentId>(expanded.arguments.size() - 1);
    };
    const Formula& mass = network.arguments[macro.mass];
    const Formula& t60_s = network.arguments[mode->t60_s];
    expanded.masses.push_back(
        {.kind = MassKind::oscillator,
         .mass = macro.mass,
         .stiffness = add(mode_stiffness(mass, network.arguments[mode->frequency_hz], t60_s)),
         .damping = add(mode_damping(mass, t60_s)),
         .is_mode = true,
         .is_fixed = macro.is_fixed,
         .location = mode->location});
    for (std::size_t place = 0; place < macro.places.size(); ++place) {
      expanded.shapes[first + place * macro.length + at] = mode->shape[place];
    }
    ++at;
  }
}

// Merges points with equal coordinates into one node, which on a waveguide is a junction.
void join_places(const Network& network, Network& expanded) {
  std::vector<std::uint32_t> waveguide;  // [macro] index among the waveguides
  for (const Macro& macro : network.macros) {
    waveguide.push_back(static_cast<std::uint32_t>(expanded.waveguides.size()));
    if (is_waveguide(macro.kind)) {
      expanded.waveguides.push_back(macro);
    }
  }
  std::map<std::tuple<std::uint32_t, ArgumentId, ArgumentId>, std::uint32_t> known;
  std::vector<std::uint32_t> same(expanded.masses.size());  // [mass] the one that replaces it
  for (std::uint32_t i = 0; i < same.size(); ++i) {
    Mass& mass = expanded.masses[i];
    same[i] = i;
    if (mass.kind != MassKind::point) {
      continue;
    }
    Tap& tap = expanded.taps[mass.tap];
    const Macro& macro = network.macros[tap.macro];
    same[i] = known.try_emplace({tap.macro, tap.u, tap.v}, i).first->second;
    if (same[i] != i) {
      mass.kind = MassKind::ground;  // unused from here on
    } else if (is_waveguide(macro.kind)) {
      tap.macro = waveguide[tap.macro];
      mass.kind = MassKind::junction;
      mass.mass = macro.impedance;
      mass.position = macro.position;
      mass.is_fixed = macro.is_fixed;
    }
  }
  for (Link& link : expanded.links) {
    link.a = same[link.a];
    link.b = same[link.b];
  }
  for (Input& input : expanded.inputs) {
    input.mass = same[input.mass];
  }
  for (Output& output : expanded.outputs) {
    output.mass = same[output.mass];
  }
}

// Splits the linear part of a curved spring at a waveguide into a link of its own. There both parts
// are solved by discrete gradients, but the passive form of a curved spring keeps the linear part
// as published (see contains_spring in core/laws/law.h).
void split_springs(Network& network) {
  const auto is_junction = [&](std::uint32_t mass) {
    return network.masses[mass].kind == MassKind::junction;
  };
  const std::size_t count = network.links.size();
  for (std::size_t i = 0; i < count; ++i) {
    Link& link = network.links[i];
    const LawFacts& law = facts_of(link.law);
    if (!law.contains_spring || !law.is_curved || !(is_junction(link.a) || is_junction(link.b))) {
      continue;
    }
    Link straight{.name = link.name,
                  .a = link.a,
                  .b = link.b,
                  .is_fixed = link.is_fixed,
                  .location = link.location};
    straight.arguments[0] = std::exchange(link.arguments[law.slot(Role::stiffness)], no_argument);
    straight.arguments[1] = std::exchange(link.arguments[law.slot(Role::damping)], no_argument);
    network.links.push_back(std::move(straight));
  }
}

}  // namespace

bool is_waveguide(MacroKind kind) {
  return kind == MacroKind::waveguide || kind == MacroKind::open_waveguide;
}

bool is_on_waveguide(const Network& network, std::uint32_t mass) {
  const Mass& place = network.masses[mass];
  return place.kind == MassKind::junction ||
         (place.kind == MassKind::point && !network.macros.empty() &&
          is_waveguide(network.macros[network.taps[place.tap].macro].kind));
}

bool has_waveguide(const Network& network) {
  return !network.waveguides.empty() ||
         std::any_of(network.macros.begin(), network.macros.end(),
                     [](const Macro& macro) { return is_waveguide(macro.kind); });
}

bool is_mesh(MacroKind kind) {
  return kind == MacroKind::mesh || kind == MacroKind::closed_mesh ||
         kind == MacroKind::corner_mesh;
}

bool is_fixed(const Macro& macro, std::uint32_t node) {
  const std::uint32_t i = node / macro.width;
  const std::uint32_t j = node % macro.width;
  const bool row_end = i == 0 || i + 1 == macro.length;
  const bool column_end = j == 0 || j + 1 == macro.width;
  switch (macro.kind) {
    case MacroKind::string:
    case MacroKind::stiff_string:
      return row_end;
    case MacroKind::closed_mesh:
      return row_end || column_end;
    case MacroKind::corner_mesh:
      return row_end && column_end;
    case MacroKind::chain:
    case MacroKind::mesh:
    case MacroKind::body:
    case MacroKind::waveguide:
    case MacroKind::open_waveguide:
      return false;
  }
  return false;
}

std::uint64_t node_count(const Macro& macro) {
  return is_waveguide(macro.kind) ? 0 : std::uint64_t{macro.length} * macro.width;
}

std::uint64_t link_count(const Macro& macro) {
  if (macro.kind == MacroKind::body || is_waveguide(macro.kind)) {
    return 0;
  }
  const std::uint64_t rows = macro.length;
  const std::uint64_t columns = macro.width;
  const std::uint64_t near = rows * (columns - 1) + (rows - 1) * columns;
  return macro.kind == MacroKind::stiff_string ? near + rows : near;
}

std::vector<std::uint32_t> macro_starts(const Network& network) {
  std::vector<std::uint32_t> starts;
  std::uint64_t next = network.masses.size();
  for (const Macro& macro : network.macros) {
    starts.push_back(static_cast<std::uint32_t>(next));
    next += node_count(macro);
  }
  return starts;
}

Network expand_macros(const Network& network, const Progress& progress) {
  Network expanded = network;
  if (network.macros.empty()) {
    return expanded;
  }
  expanded.macros.clear();
  expanded.modes.clear();
  std::size_t nodes = network.masses.size();
  std::size_t links = network.links.size();
  for (const Macro& macro : network.macros) {
    nodes += node_count(macro);
    links += link_count(macro);
  }
  join_places(network, expanded);
  expanded.masses.reserve(nodes);
  expanded.links.reserve(links);
  const std::vector<std::uint32_t> first = macro_starts(network);  // [macro]
  std::vector<std::uint32_t> shape;
  for (std::uint32_t i = 0; i < network.macros.size(); ++i) {
    const Macro& macro = network.macros[i];
    shape.push_back(static_cast<std::uint32_t>(expanded.shapes.size()));
    if (macro.kind == MacroKind::body) {
      add_modes(network, i, progress, expanded);
    } else if (!is_waveguide(macro.kind)) {
      add_nodes(macro, progress, expanded);
      add_links(macro, first[i], progress, expanded);
    }
  }
  for (std::size_t i = 0; i < expanded.taps.size(); ++i) {
    Tap& tap = expanded.taps[i];
    const Macro& macro = network.macros[network.taps[i].macro];
    if (is_waveguide(macro.kind)) {
      continue;
    }
    tap.length = macro.length;
    tap.width = macro.width;
    tap.first = first[tap.macro];
    tap.places = static_cast<std::uint32_t>(macro.places.size());
    tap.shape = shape[tap.macro];
  }
  split_springs(expanded);
  return expanded;
}

}  // namespace ressort::model
