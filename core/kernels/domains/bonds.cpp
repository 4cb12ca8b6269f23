#include "core/kernels/domains/bonds.h"

#include <algorithm>
#include <numeric>

#include "core/kernels/domains/halos.h"
#include "core/kernels/kernel.h"
#include "core/kernels/taps.h"

namespace ressort::kernels {
namespace {

// Calls use(place in tap_nodes) for the nodes around a point, in single and in double precision.
template <class Use>
void each_corner_of(const Program& program, const TapSlot& tap, Use&& use) {
  const auto value = [&](std::uint32_t c) {
    return coefficient_value(program, program.coefficients[c], program.parameters, 1.0);
  };
  const auto add = [&](std::uint32_t at, auto) { use(at); };
  each_corner(corners_at(tap, value(tap.u), value(tap.v)), add);
  each_corner(corners_at(tap, static_cast<float>(value(tap.u)), static_cast<float>(value(tap.v))),
              add);
}

// Returns the nodes around every point, in single or double precision; empty if a point may move.
std::optional<std::vector<std::vector<std::uint32_t>>> corners_of(const Program& program) {
  std::vector<bool> wanders(program.coefficients.size(), false);
  for (const auto& coefficients : program.depending) {
    for (const std::uint32_t c : coefficients) {
      wanders[c] = true;
    }
  }
  std::vector<std::vector<std::uint32_t>> corners;
  for (const TapSlot& tap : program.taps) {
    if (wanders[tap.u] || wanders[tap.v] || tap.is_on_body()) {
      return std::nullopt;
    }
    auto& nodes = corners.emplace_back();
    each_corner_of(program, tap, [&](std::uint32_t at) { nodes.push_back(program.tap_nodes[at]); });
    std::sort(nodes.begin(), nodes.end());
    nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
  }
  return corners;
}

}  // namespace

std::optional<Bonds> Bonds::of(const Program& program) {
  auto corners = corners_of(program);
  return corners ? std::optional(Bonds(program, *std::move(corners))) : std::nullopt;
}

// Calls use(a, b), in either order, for all nodes that influence each other within one sample.
template <class Use>
void Bonds::each_bond(Use&& use) const {
  const auto join = [&](std::uint32_t a, std::uint32_t b) {
    each_behind(a, [&](std::uint32_t p) { each_behind(b, [&](std::uint32_t q) { use(p, q); }); });
  };
  for (const auto& [a, b] : program_.ends) {
    join(a, b);
  }
  for (const TapSlot& tap : program_.taps) {
    join(tap.node, tap.node);
  }
}

// Builds the lists in two passes. Each pass calls each_pair(add), which calls add(node, item) for
// all items, in the same order.
template <class EachPair>
Bonds::Lists Bonds::lists_of(EachPair&& each_pair) const {
  Lists lists{.first = std::vector<std::size_t>(binds_.size() + 1, 0), .items = {}};
  each_pair([&](std::uint32_t node, std::uint32_t) { ++lists.first[node + 1]; });
  std::partial_sum(lists.first.begin(), lists.first.end(), lists.first.begin());
  lists.items.resize(lists.first.back());
  std::vector<std::size_t> next(lists.first.begin(), lists.first.end() - 1);
  each_pair([&](std::uint32_t node, std::uint32_t item) { lists.items[next[node]++] = item; });
  return lists;
}

Bonds::Bonds(const Program& program, std::vector<std::vector<std::uint32_t>> corners)
    : program_(program),
      corners_(std::move(corners)),
      first_point_(program.taps.empty() ? nobody : program.taps[0].node),
      binds_(program.position.size(), false),
      is_tied_(program.position.size(), false) {
  std::fill_n(binds_.begin(), program.moving, true);
  // The force on a fixed node is the sum over all its links, wherever they lead.
  for (const OutputSlot& output : program.outputs) {
    binds_[output.node] = binds_[output.node] || output.is_force;
  }
  for (const TapSlot& tap : program.taps) {
    binds_[tap.node] = true;
  }
  for (const auto& [a, b] : program.ends) {
    is_tied_[a] = is_tied_[a] || binds_[b];
    is_tied_[b] = is_tied_[b] || binds_[a];
  }
  neighbours_ = lists_of([&](const auto& add) {
    each_bond([&](std::uint32_t a, std::uint32_t b) {
      add(a, b);
      add(b, a);
    });
  });
  links_ = lists_of([&](const auto& add) {
    for (std::uint32_t link = 0; link < program_.ends.size(); ++link) {
      add(program_.ends[link].a, link);
      add(program_.ends[link].b, link);
    }
  });
}

std::vector<std::uint32_t> Bonds::as_written() const {
  std::vector<std::uint32_t> order;
  for (std::uint32_t node = 0; node < binds_.size(); ++node) {
    if (binds_[node] && !is_point(node)) {
      order.push_back(node);
    }
  }
  return order;
}

std::vector<std::uint32_t> Bonds::breadth_first() const {
  std::vector<std::uint32_t> order;
  std::vector<bool> is_seen(binds_.size(), false);
  const auto see = [&](std::uint32_t node) {
    if (binds_[node] && !is_point(node) && !is_seen[node]) {
      is_seen[node] = true;
      order.push_back(node);
    }
  };
  std::size_t next = 0;
  for (std::uint32_t root = 0; root < binds_.size(); ++root) {
    for (see(root); next < order.size(); ++next) {
      each_neighbour(order[next], see);
    }
  }
  return order;
}

Surroundings Bonds::surroundings(const std::vector<std::uint32_t>& own, std::uint32_t levels,
                                 std::vector<bool>& is_seen) const {
  Surroundings around{.nodes = own, .begin = {0, own.size()}};
  for (const std::uint32_t node : own) {
    is_seen[node] = true;
  }
  for (std::uint32_t reached = 1; reached <= levels; ++reached) {
    for (std::size_t i = around.begin[reached - 1]; i < around.begin[reached]; ++i) {
      each_neighbour(around.nodes[i], [&](std::uint32_t neighbour) {
        if (!is_seen[neighbour]) {
          is_seen[neighbour] = true;
          around.nodes.push_back(neighbour);
        }
      });
    }
    around.begin.push_back(around.nodes.size());
  }
  for (const std::uint32_t node : around.nodes) {
    is_seen[node] = false;
  }
  return around;
}

std::pair<std::uint32_t, std::uint32_t> Bonds::nodes_around(const TapSlot& tap) const {
  std::uint32_t first = nobody;
  std::uint32_t last = 0;
  each_corner_of(program_, tap, [&](std::uint32_t at) {
    first = std::min(first, at);
    last = std::max(last, at);
  });
  return {first, last + 1};
}

}  // namespace ressort::kernels
