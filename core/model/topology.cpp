#include "core/model/topology.h"

#include <algorithm>
#include <cmath>
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

// Returns M ((2 pi f)^2 + s^2), per sample. `rate`: s, the rate of decay per sample.
Formula mode_stiffness(const Formula& mass, const Formula& frequency_hz, const Formula& rate) {
  constexpr double turn = 2.0 * std::numbers::pi / Network::reference_rate_hz;
  Formula formula = mass;
  append(formula, frequency_hz);
  append(formula, {{Op::number, 0, turn}, {Op::multiply}, {Op::number, 0, 2.0}, {Op::power}});
  append(formula, rate);
  append(formula, {{Op::number, 0, 2.0}, {Op::power}, {Op::add}, {Op::multiply}});
  return folded(std::move(formula));
}

// Returns ln 1000 / T60, per sample.
Formula decay_rate(const Formula& t60_s) {
  Formula formula = {{Op::number, 0, 3.0 * std::numbers::ln10 / Network::reference_rate_hz}};
  append(formula, t60_s);
  formula.push_back({Op::divide});
  return formula;
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
    const Formula& mass = network.arguments[macro.mass];
    const Formula& t60_s = network.arguments[mode->t60_s];
    expanded.masses.push_back({.kind = MassKind::oscillator,
                               .mass = macro.mass,
                               .stiffness = expanded.add(mode_stiffness(
                                   mass, network.arguments[mode->frequency_hz], decay_rate(t60_s))),
                               .damping = expanded.add(mode_damping(mass, t60_s)),
                               .is_mode = true,
                               .is_fixed = macro.is_fixed,
                               .location = mode->location});
    for (std::size_t place = 0; place < macro.places.size(); ++place) {
      expanded.shapes[first + place * macro.length + at] = mode->shape[place];
    }
    ++at;
  }
}

// Expands modal strings: modes, mode shapes at the places in use, and the bridge.
class StringModes {
 public:
  StringModes(const Network& network, std::uint32_t macro, Network& expanded)
      : network_(network),
        expanded_(expanded),
        string_(network.macros[macro]),
        macro_(macro),
        modes_(string_.length * string_.width) {}

  // Appends the modes as oscillators, partial by partial, and a bridge that damps all strings.
  void add_nodes(const Progress& progress) {
    first_ = static_cast<std::uint32_t>(expanded_.masses.size());
    Formula mass = network_.arguments[string_.mass];
    append(mass, {{Op::number, 0, 0.5}, {Op::multiply}});
    mass = folded(std::move(mass));
    const ArgumentId mass_id = expanded_.add(mass);
    for (std::uint32_t n = 1; n <= string_.length; ++n) {
      const Formula rate = rate_of(n);
      Formula damping = mass;
      append(damping, {{Op::number, 0, 2.0}, {Op::multiply}});
      append(damping, rate);
      append(damping, {{Op::multiply}});
      const ArgumentId damping_id = expanded_.add(folded(std::move(damping)));
      for (std::uint32_t string = 0; string < string_.width; ++string) {
        progress.spend(16);
        expanded_.masses.push_back(
            {.kind = MassKind::oscillator,
             .mass = mass_id,
             .stiffness = expanded_.add(mode_stiffness(mass, hz_of(n, string), rate)),
             .damping = damping_id,
             .is_mode = true,
             .is_fixed = string_.is_fixed,
             .location = string_.location});
      }
    }
    if (string_.bridge_loss != no_argument) {
      add_bridge();
    }
  }

  // Sets the mode shapes of a place on the string. Constant places are exact. A variable one lies
  // on a grid, with 16 points in a wave of the highest partial.
  void place(Tap& tap) {
    tap.length = modes_;
    tap.width = 1;
    tap.first = first_;
    tap.shape = static_cast<std::uint32_t>(expanded_.shapes.size());
    tap.places = 1;
    const double share = 1.0 / string_.width;
    if (tap.u == no_argument) {
      return add_shape([&](std::uint32_t n) { return share * n * sign_of(n); });
    }
    const Formula& place = network_.arguments[tap.u];
    const bool is_exact = is_constant(place);
    tap.places = is_exact ? 1 : 8 * string_.length + 1;
    for (std::uint32_t i = 0; i < tap.places; ++i) {
      const double u = is_exact ? std::clamp(evaluate(place, {}), 0.0, 1.0)
                                : i / static_cast<double>(tap.places - 1);
      add_shape([&](std::uint32_t n) { return share * std::sin(std::numbers::pi * n * u); });
    }
  }

 private:
  static double sign_of(std::uint32_t partial) { return partial % 2 == 1 ? 1.0 : -1.0; }

  // Appends the same displacement for each string.
  template <class OfPartial>
  void add_shape(OfPartial&& of_partial) {
    for (std::uint32_t n = 1; n <= string_.length; ++n) {
      expanded_.shapes.insert(expanded_.shapes.end(), string_.width, of_partial(n));
    }
  }

  // Returns n HZ sqrt((1 + B n^2) / (1 + B)), detuned for one of several strings. The quotient is
  // written as n^2 - (n^2 - 1) / (1 + B), where B occurs once, for the bounds of its range.
  Formula hz_of(std::uint32_t n, std::uint32_t string) const {
    const double square = static_cast<double>(n) * n;
    Formula stretch = {
        {Op::number, 0, square}, {Op::number, 0, square - 1.0}, {Op::number, 0, 1.0}};
    append(stretch, network_.arguments[string_.inharmonicity]);
    append(stretch, {{Op::add},
                     {Op::divide},
                     {Op::subtract},
                     {Op::sqrt},
                     {Op::number, 0, static_cast<double>(n)},
                     {Op::multiply}});
    Formula formula = folded(std::move(stretch));
    append(formula, network_.arguments[string_.frequency_hz]);
    formula.push_back({Op::multiply});
    if (string_.width > 1) {
      const double octaves = (string / (string_.width - 1.0) - 0.5) / 1200.0;
      formula.push_back({Op::number, 0, 2.0});
      append(formula, network_.arguments[string_.spread_cents]);
      append(formula, {{Op::number, 0, octaves}, {Op::multiply}, {Op::power}, {Op::multiply}});
    }
    return formula;
  }

  // Returns S0 + S1 n + S3 n^3, per sample.
  Formula rate_of(std::uint32_t n) const {
    const double number = n;
    Formula formula = network_.arguments[string_.losses[0]];
    append(formula, network_.arguments[string_.losses[1]]);
    append(formula, {{Op::number, 0, number}, {Op::multiply}, {Op::add}});
    append(formula, network_.arguments[string_.losses[2]]);
    append(formula, {{Op::number, 0, number * number * number},
                     {Op::multiply},
                     {Op::add},
                     {Op::number, 0, 1.0 / Network::reference_rate_hz},
                     {Op::multiply}});
    return folded(std::move(formula));
  }

  // Appends a damper from the ends of all strings to a ground. A bridge of conductance G loses the
  // same share of every partial, so all modes move its place alike. It couples the strings
  // (Weinreich 1977): each loses energy at the rate of the sum of their motions.
  void add_bridge() {
    Tap tap{.macro = macro_,
            .first = first_,
            .length = modes_,
            .width = 1,
            .places = 1,
            .shape = static_cast<std::uint32_t>(expanded_.shapes.size())};
    add_shape(sign_of);
    Mass place{.kind = MassKind::point, .tap = static_cast<std::uint32_t>(expanded_.taps.size())};
    place.location = string_.location;
    expanded_.taps.push_back(tap);
    Mass ground{.kind = MassKind::ground, .location = string_.location};
    Formula damping = network_.arguments[string_.mass];  // 2 (M/2) g
    append(damping, network_.arguments[string_.bridge_loss]);
    append(damping,
           {{Op::multiply}, {Op::number, 0, 1.0 / Network::reference_rate_hz}, {Op::multiply}});
    Link damper{.location = string_.location};
    damper.a = static_cast<std::uint32_t>(expanded_.masses.size());
    damper.b = damper.a + 1;
    damper.arguments[1] = expanded_.add(folded(std::move(damping)));
    expanded_.masses.push_back(std::move(place));
    expanded_.masses.push_back(std::move(ground));
    expanded_.links.push_back(std::move(damper));
  }

  const Network& network_;
  Network& expanded_;
  const Macro& string_;
  std::uint32_t macro_;
  std::uint32_t modes_;
  std::uint32_t first_ = 0;
};

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
  return !network.waveguides.empty() || std::ranges::any_of(network.macros, [](const Macro& macro) {
    return is_waveguide(macro.kind);
  });
}

bool consists_of_modes(MacroKind kind) {
  return kind == MacroKind::body || kind == MacroKind::modal_string;
}

bool is_bridge(const Network& network, const Tap& tap) {
  return network.macros[tap.macro].kind == MacroKind::modal_string && tap.u == no_argument;
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
    case MacroKind::modal_string:
      return false;
  }
  return false;
}

std::uint64_t node_count(const Macro& macro) {
  const std::uint64_t bridge = macro.bridge_loss == no_argument ? 0 : 2;  // a place and a ground
  return is_waveguide(macro.kind) ? 0 : std::uint64_t{macro.length} * macro.width + bridge;
}

std::uint64_t link_count(const Macro& macro) {
  if (macro.kind == MacroKind::modal_string) {
    return macro.bridge_loss == no_argument ? 0 : 1;
  }
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
  std::map<std::uint32_t, StringModes> strings;  // macro -> its modes
  for (std::uint32_t i = 0; i < network.macros.size(); ++i) {
    const Macro& macro = network.macros[i];
    shape.push_back(static_cast<std::uint32_t>(expanded.shapes.size()));
    if (macro.kind == MacroKind::body) {
      add_modes(network, i, progress, expanded);
    } else if (macro.kind == MacroKind::modal_string) {
      strings.try_emplace(i, network, i, expanded).first->second.add_nodes(progress);
    } else if (!is_waveguide(macro.kind)) {
      add_nodes(macro, progress, expanded);
      add_links(macro, first[i], progress, expanded);
    }
  }
  for (std::size_t i = 0; i < network.taps.size(); ++i) {
    Tap& tap = expanded.taps[i];
    const Macro& macro = network.macros[network.taps[i].macro];
    if (is_waveguide(macro.kind)) {
      continue;
    }
    if (const auto string = strings.find(tap.macro); string != strings.end()) {
      string->second.place(tap);
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
