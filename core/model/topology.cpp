#include "core/model/topology.h"

namespace ressort {
namespace {

bool is_fixed(const Macro& macro, std::uint32_t i, std::uint32_t j) {
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
      return false;
  }
  return false;
}

std::size_t link_count(const Macro& macro) {
  const std::size_t rows = macro.length;
  const std::size_t columns = macro.width;
  const std::size_t near = rows * (columns - 1) + (rows - 1) * columns;
  return macro.kind == MacroKind::stiff_string ? near + rows : near;
}

void add_nodes(const Macro& macro, const Progress& progress, Network& network) {
  for (std::uint32_t i = 0; i < macro.length; ++i) {
    progress.spend(4 * std::size_t{macro.width});
    for (std::uint32_t j = 0; j < macro.width; ++j) {
      Mass node{.position = macro.position, .third = macro.third, .location = macro.location};
      if (is_fixed(macro, i, j)) {
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
}

void add_links(const Macro& macro, std::uint32_t first, const Progress& progress,
               Network& network) {
  const auto add = [&](std::uint32_t a, std::uint32_t b, ArgumentId stiffness, ArgumentId damping) {
    Link link{.a = first + a, .b = first + b, .location = macro.location};
    link.arguments[0] = stiffness;
    link.arguments[1] = damping;
    network.links.push_back(std::move(link));
  };
  const std::uint32_t rows = macro.length;
  const std::uint32_t columns = macro.width;
  for (std::uint32_t i = 0; i < rows; ++i) {
    progress.spend(4 * std::size_t{columns});
    for (std::uint32_t j = 0; j + 1 < columns; ++j) {
      add(i * columns + j, i * columns + j + 1, macro.stiffness, macro.damping);
    }
  }
  for (std::uint32_t i = 0; i + 1 < rows; ++i) {
    progress.spend(4 * std::size_t{columns});
    for (std::uint32_t j = 0; j < columns; ++j) {
      add(i * columns + j, (i + 1) * columns + j, macro.stiffness, macro.damping);
    }
  }
  if (macro.kind == MacroKind::stiff_string) {
    for (std::uint32_t i = 0; i + 2 < rows; ++i) {
      add(i, i + 2, macro.second_stiffness, no_argument);
    }
    add(0, 1, macro.second_stiffness, no_argument);
    add(rows - 2, rows - 1, macro.second_stiffness, no_argument);
  }
}

}  // namespace

bool is_mesh(MacroKind kind) {
  return kind == MacroKind::mesh || kind == MacroKind::closed_mesh ||
         kind == MacroKind::corner_mesh;
}

std::uint64_t node_count(const Macro& macro) {
  return std::uint64_t{macro.length} * macro.width;
}

Network expand_macros(const Network& network, const Progress& progress) {
  Network expanded = network;
  if (network.macros.empty()) {
    return expanded;
  }
  expanded.macros.clear();
  std::size_t nodes = network.masses.size();
  std::size_t links = network.links.size();
  for (const Macro& macro : network.macros) {
    nodes += node_count(macro);
    links += link_count(macro);
  }
  expanded.masses.reserve(nodes);
  expanded.links.reserve(links);
  std::vector<std::uint32_t> first;
  for (const Macro& macro : network.macros) {
    first.push_back(static_cast<std::uint32_t>(expanded.masses.size()));
    add_nodes(macro, progress, expanded);
    add_links(macro, first.back(), progress, expanded);
  }
  for (Tap& tap : expanded.taps) {
    const Macro& macro = network.macros[tap.macro];
    tap.first = first[tap.macro];
    tap.length = macro.length;
    tap.width = macro.width;
  }
  return expanded;
}

}  // namespace ressort
