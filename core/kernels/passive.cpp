#include "core/kernels/passive.h"

#include <algorithm>

namespace ressort {
namespace {

// Calls `use(node)` for every node that a link's end may move.
template <class Use>
void each_moved(const Program& program, std::uint32_t end, Use&& use) {
  if (end < program.moving) {
    use(end);
  }
  for (const TapSlot& tap : program.taps) {
    for (std::uint32_t i = 0; tap.node == end && i < tap.length * tap.width; ++i) {
      use(program.tap_nodes[tap.first + i]);
    }
  }
}

}  // namespace

bool holds_places(const Program& program) {
  if (program.taps.empty()) {
    return false;
  }
  const std::vector<PassiveLink> links = passive_links(program);
  const std::uint32_t first = program.taps[0].node;
  return std::any_of(links.begin(), links.end(), [&](const PassiveLink& link) {
    return link.ends.a >= first || link.ends.b >= first;
  });
}

std::vector<std::uint32_t> inverse_masses(const Program& program) {
  std::vector<std::uint32_t> coefficients(program.moving);
  for (const MassRun& run : program.mass_runs) {
    std::fill_n(coefficients.begin() + run.first, run.count, run.inverse_mass);
  }
  return coefficients;
}

std::vector<PassiveLink> passive_links(const Program& program) {
  std::vector<PassiveLink> links;
  for (const LinkRun& run : program.link_runs) {
    for (std::uint32_t i = run.first; run.scheme != Scheme::plain && i < run.first + run.count;
         ++i) {
      links.push_back({.law = run.law,
                       .is_implicit = run.scheme == Scheme::discrete_gradient &&
                                      facts_of(run.law).has_discrete_gradient,
                       .substeps = std::clamp<int>(run.substeps, 1, most_substeps),
                       .coefficients = run.coefficients,
                       .ends = program.ends[i]});
    }
  }
  std::vector<std::uint32_t> holders(program.position.size(), 0);
  const auto each = [&](const PassiveLink& link, auto&& use) {
    each_moved(program, link.ends.a, use);
    each_moved(program, link.ends.b, use);
  };
  for (const PassiveLink& link : links) {
    std::vector<std::uint32_t> moved;
    each(link, [&](std::uint32_t node) { moved.push_back(node); });
    std::sort(moved.begin(), moved.end());
    moved.erase(std::unique(moved.begin(), moved.end()), moved.end());
    for (const std::uint32_t node : moved) {
      ++holders[node];
    }
  }
  for (PassiveLink& link : links) {
    each(link, [&](std::uint32_t node) { link.is_shared |= holders[node] > 1; });
  }
  return links;
}

}  // namespace ressort
