#include "core/compile/plan.h"

#include <algorithm>
#include <map>
#include <numeric>

namespace ressort {
namespace {

bool moves(const Mass& mass) {
  return mass.kind == MassKind::mass || mass.kind == MassKind::oscillator;
}

// Which masses hang together, by union-find; what does not move holds nothing together.
std::vector<std::uint32_t> connected(const Network& network) {
  std::vector<std::uint32_t> root(network.masses.size());
  std::iota(root.begin(), root.end(), 0u);
  const auto find = [&](std::uint32_t i) {
    while (root[i] != i) {
      i = root[i] = root[root[i]];
    }
    return i;
  };
  for (const Link& link : network.links) {
    if (moves(network.masses[link.a]) && moves(network.masses[link.b])) {
      root[find(link.a)] = find(link.b);
    }
  }
  for (std::uint32_t i = 0; i < root.size(); ++i) {
    root[i] = find(i);
  }
  return root;
}

}  // namespace

std::string_view method_name(Method method) {
  switch (method) {
    case Method::direct:
      return "direct";
  }
  return "";
}

Plan make_plan(const Network& network) {
  const std::vector<std::uint32_t> root = connected(network);
  struct Count {
    std::size_t masses = 0;
    std::size_t links = 0;
    std::size_t nonlinear = 0;
  };
  std::map<std::uint32_t, Count> counts;
  for (std::uint32_t i = 0; i < root.size(); ++i) {
    if (moves(network.masses[i])) {
      ++counts[root[i]].masses;
    }
  }
  for (const Link& link : network.links) {
    const std::uint32_t end = moves(network.masses[link.a]) ? link.a : link.b;
    if (moves(network.masses[end])) {
      Count& count = counts[root[end]];
      ++count.links;
      count.nonlinear += link.kind == LinkKind::spring ? 0 : 1;
    }
  }
  Plan plan;
  for (const auto& [first, count] : counts) {
    std::string reason = "the published scheme, mass by mass and link by link; ";
    reason += count.nonlinear == 0   ? std::string("every link is linear")
              : count.nonlinear == 1 ? std::string("one link is nonlinear")
                                     : std::to_string(count.nonlinear) + " links are nonlinear";
    plan.parts.push_back({Method::direct, count.masses, count.links, std::move(reason)});
  }
  return plan;
}

std::string describe(const Plan& plan) {
  std::string text;
  for (const Part& part : plan.parts) {
    text += std::string(method_name(part.method)) + ": " + std::to_string(part.masses) +
            (part.masses == 1 ? " mass, " : " masses, ") + std::to_string(part.links) +
            (part.links == 1 ? " link (" : " links (") + part.reason + ")\n";
  }
  return text.empty() ? "nothing moves\n" : text;
}

}  // namespace ressort
