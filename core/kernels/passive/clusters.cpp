#include "core/kernels/passive/clusters.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <set>
#include <span>
#include <utility>

#include "core/groups.h"
#include "core/laws/law.h"

namespace ressort::kernels {
namespace {

// Calls `use(node)` for every node that a link's end may move.
template <class Use>
void each_moved(const Program& program, std::uint32_t end, Use&& use) {
  if (end < program.moving) {
    use(end);
  }
  for (const TapSlot& tap : program.taps) {
    for (std::uint32_t i = 0; tap.node == end && i < tap.length * tap.width; ++i) {
      const std::uint32_t node = program.tap_nodes[tap.first + i];
      if (node < program.moving) {
        use(node);
      }
    }
  }
}

bool is_place(const Program& program, std::uint32_t node) {
  return !program.taps.empty() && node >= program.taps[0].node;
}

std::vector<PassiveLink> passive_links_of(const Program& program) {
  std::vector<PassiveLink> links;
  for (const LinkRun& run : program.link_runs) {
    const LawFacts& law = facts_of(run.law);
    for (std::uint32_t i = run.first; run.scheme != Scheme::plain && i < run.first + run.count;
         ++i) {
      links.push_back({.law = run.law,
                       .coefficients = run.coefficients,
                       .ends = program.ends[i],
                       .zone = law.zone,
                       .reach = law.can_detach() ? run.coefficients[law.slot(Role::reach)] : 0});
    }
  }
  return links;
}

// Symbolic elimination in minimum-degree order: eliminates the mass with the fewest neighbours and
// makes its neighbours adjacent. Places on macros come after the masses; they are not eliminated
// and are all adjacent.
class Eliminator {
 public:
  Eliminator(std::size_t masses, std::size_t places)
      : masses_(masses), neighbours_(masses + places) {}

  void meet(std::uint32_t a, std::uint32_t b) {
    if (a != b) {
      neighbours_[a].insert(b);
      neighbours_[b].insert(a);
    }
  }

  // Returns [end] its number, masses in elimination order; empty if the fill-in is too large to
  // factor in every sample.
  std::vector<std::uint32_t> order() {
    constexpr std::size_t most_products = std::size_t{1} << 21;
    const std::size_t places = neighbours_.size() - masses_;
    std::size_t products = places * places * places;
    std::set<std::pair<std::size_t, std::uint32_t>> waiting;
    for (std::uint32_t mass = 0; mass < masses_; ++mass) {
      waiting.insert({neighbours_[mass].size(), mass});
    }
    std::vector<std::uint32_t> place(neighbours_.size());
    std::iota(place.begin(), place.end(), 0u);
    std::vector<std::vector<std::uint32_t>> columns;
    while (!waiting.empty()) {
      const std::uint32_t mass = waiting.begin()->second;
      waiting.erase(waiting.begin());
      place[mass] = static_cast<std::uint32_t>(columns.size());
      const std::set<std::uint32_t>& near = neighbours_[mass];
      products += near.size() * (near.size() + 1) / 2;
      if (products > most_products) {
        return {};
      }
      columns.emplace_back(near.begin(), near.end());
      for (const std::uint32_t one : near) {
        const bool waits = one < masses_ && waiting.erase({neighbours_[one].size(), one}) > 0;
        neighbours_[one].erase(mass);
        for (const std::uint32_t other : near) {
          if (other != one) {
            neighbours_[one].insert(other);
          }
        }
        if (waits) {
          waiting.insert({neighbours_[one].size(), one});
        }
      }
    }
    tabulate(columns, place);
    return place;
  }

  const Elimination& elimination() const { return elimination_; }
  std::uint32_t entry(std::uint32_t a, std::uint32_t b) const {
    return a == b ? a : entries_.at({std::min(a, b), std::max(a, b)});
  }

 private:
  void tabulate(std::vector<std::vector<std::uint32_t>>& columns,
                const std::vector<std::uint32_t>& place) {
    const auto ends = static_cast<std::uint32_t>(place.size());
    for (std::vector<std::uint32_t>& column : columns) {
      for (std::uint32_t& end : column) {
        end = place[end];
      }
      std::sort(column.begin(), column.end());
    }
    while (columns.size() < ends) {
      columns.emplace_back(ends - columns.size() - 1);
      std::iota(columns.back().begin(), columns.back().end(),
                static_cast<std::uint32_t>(columns.size()));
    }
    elimination_.first.push_back(0);
    for (std::uint32_t column = 0; column < ends; ++column) {
      for (const std::uint32_t row : columns[column]) {
        entries_[{column, row}] = ends + static_cast<std::uint32_t>(elimination_.row.size());
        elimination_.row.push_back(row);
      }
      elimination_.first.push_back(static_cast<std::uint32_t>(elimination_.row.size()));
    }
    for (std::size_t mass = 0; mass < masses_; ++mass) {
      const std::vector<std::uint32_t>& column = columns[mass];
      for (std::size_t i = 0; i < column.size(); ++i) {
        for (std::size_t k = 0; k <= i; ++k) {
          elimination_.target.push_back(entry(column[k], column[i]));
        }
      }
    }
  }

  std::size_t masses_;
  std::vector<std::set<std::uint32_t>> neighbours_;
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> entries_;
  Elimination elimination_;
};

// The moving ends of links and their numbers: masses, then places. Masses of a macro are reached
// only through places.
struct HeldEnds {
  std::map<std::uint32_t, std::uint32_t> ends;  // Keyed by node.
  std::size_t masses = 0;
};

HeldEnds held_by(const Program& program, std::span<const PassiveLink> links) {
  std::set<std::uint32_t> places;
  HeldEnds held;
  const auto count = [&](std::uint32_t node) {
    held.ends.try_emplace(node, static_cast<std::uint32_t>(held.ends.size()));
  };
  for (const PassiveLink& link : links) {
    for (const std::uint32_t node : {link.ends.a, link.ends.b}) {
      if (node < program.moving) {
        count(node);
      } else if (is_place(program, node)) {
        places.insert(node);
      }
    }
  }
  held.masses = held.ends.size();
  std::for_each(places.begin(), places.end(), count);
  return held;
}

// Chooses the solution by ends unless the cluster has fewer links than places.
void find_elimination(const Program& program, std::vector<PassiveLink>& all, Cluster& cluster) {
  const std::span<PassiveLink> links = std::span(all).subspan(cluster.first, cluster.count);
  const HeldEnds held = held_by(program, links);
  const std::size_t places = held.ends.size() - held.masses;
  if (2 * places > links.size()) {
    return;
  }
  const auto number_of = [&](std::uint32_t node) {
    const auto end = held.ends.find(node);
    return end == held.ends.end() ? no_mass : end->second;
  };
  Eliminator eliminator(held.masses, places);
  for (PassiveLink& link : links) {
    link.mass_a = number_of(link.ends.a);
    link.mass_b = number_of(link.ends.b);
    if (link.mass_a != no_mass && link.mass_b != no_mass) {
      eliminator.meet(link.mass_a, link.mass_b);
    }
  }
  std::vector<std::uint32_t> place = eliminator.order();
  const bool is_factorised = !place.empty();
  if (!is_factorised && places > 0) {
    return;
  }
  if (!is_factorised) {
    place.resize(held.masses);
    std::iota(place.begin(), place.end(), 0u);
  }
  for (PassiveLink& link : links) {
    for (std::uint32_t* end : {&link.mass_a, &link.mass_b}) {
      *end = *end == no_mass ? no_mass : place[*end];
    }
    if (is_factorised && link.mass_a != no_mass && link.mass_b != no_mass &&
        link.mass_a != link.mass_b) {
      link.entry = eliminator.entry(link.mass_a, link.mass_b);
    }
  }
  cluster.elimination = eliminator.elimination();
  cluster.inverse_mass.resize(held.masses);
  cluster.places.resize(places);
  const std::vector<std::uint32_t> inverse_mass = inverse_masses(program);
  for (const auto& [node, end] : held.ends) {
    if (end < held.masses) {
      cluster.inverse_mass[place[end]] = inverse_mass[node];
    } else {
      cluster.places[end - held.masses] = node;
    }
  }
}

// Returns whether the link is a nonlinear spring with the published linear part, between masses and
// fixed nodes.
bool may_be_in_web(const Program& program, const PassiveLink& link) {
  const LawFacts& law = facts_of(link.law);
  const auto is_mass = [&](std::uint32_t node) {
    return !is_place(program, node) && !is_junction(program, node);
  };
  return law.contains_spring && law.is_curved && is_mass(link.ends.a) && is_mass(link.ends.b);
}

// Makes a web of the links from `first` on.
Web web_of(const Program& program, std::vector<PassiveLink>& links, std::size_t first) {
  Web web{.first = static_cast<std::uint32_t>(first),
          .count = static_cast<std::uint32_t>(links.size() - first)};
  const std::vector<std::uint32_t> inverse_mass = inverse_masses(program);
  std::map<std::uint32_t, std::uint32_t> ends;  // Keyed by node.
  for (std::size_t i = first; i < links.size(); ++i) {
    PassiveLink& link = links[i];
    const auto end_of = [&](std::uint32_t node, std::size_t side) {
      const auto [end, is_new] = ends.try_emplace(node, static_cast<std::uint32_t>(ends.size()));
      if (is_new) {
        web.inverse_mass.push_back(node < program.moving ? inverse_mass[node] : no_mass);
        web.of.push_back(static_cast<std::uint32_t>(2 * (i - first) + side));
      }
      return end->second;
    };
    link.mass_a = end_of(link.ends.a, 0);
    link.mass_b = end_of(link.ends.b, 1);
    const bool is_alike =
        i > first && link.law == links[i - 1].law && link.coefficients == links[i - 1].coefficients;
    if (!is_alike) {
      web.alike.push_back(0);
    }
    ++web.alike.back();
  }
  for (std::size_t i = 0; i < first; ++i) {
    const auto end_of = [&](std::uint32_t node) {
      const auto end = ends.find(node);
      return end == ends.end() ? no_mass : end->second;
    };
    links[i].mass_a = end_of(links[i].ends.a);
    links[i].mass_b = end_of(links[i].ends.b);
  }
  return web;
}

// Puts nonlinear springs after all other links.
PassiveTables tables_with_web(const Program& program, std::vector<PassiveLink> links) {
  const auto springs =
      std::stable_partition(links.begin(), links.end(),
                            [&](const PassiveLink& link) { return !may_be_in_web(program, link); });
  const auto others = static_cast<std::size_t>(springs - links.begin());
  PassiveTables tables;
  tables.web = web_of(program, links, others);
  tables.links = std::move(links);
  if (others > 0) {
    tables.clusters.push_back({.count = static_cast<std::uint32_t>(others)});
  }
  return tables;
}

}  // namespace

std::size_t springs_of_web(const Program& program) {
  constexpr std::size_t most_solved = 256;
  // Limit on other links, whose matrix grows with the square of their number.
  constexpr std::size_t most_others = 64;
  const std::vector<PassiveLink> links = passive_links_of(program);
  const auto springs = static_cast<std::size_t>(
      std::count_if(links.begin(), links.end(),
                    [&](const PassiveLink& link) { return may_be_in_web(program, link); }));
  return springs > most_solved && links.size() - springs <= most_others ? springs : 0;
}

std::size_t Cluster::numbers() const {
  const std::size_t own = joint_numbers * count;
  return ends() == 0 ? own + std::size_t{2} * count * count + std::size_t{5} * count
                     : own + 9 * ends() + elimination.row.size() + place_numbers(places.size());
}

bool holds_places(const Program& program) {
  if (program.taps.empty()) {
    return false;
  }
  const std::vector<PassiveLink> links = passive_links_of(program);
  return std::any_of(links.begin(), links.end(), [&](const PassiveLink& link) {
    return is_place(program, link.ends.a) || is_place(program, link.ends.b);
  });
}

std::vector<std::uint32_t> inverse_masses(const Program& program) {
  std::vector<std::uint32_t> coefficients(program.moving);
  for (const MassRun& run : program.mass_runs) {
    std::fill_n(coefficients.begin() + run.first, run.count, run.inverse_mass);
  }
  return coefficients;
}

PassiveTables passive_tables(const Program& program) {
  std::vector<PassiveLink> links = passive_links_of(program);
  if (springs_of_web(program) > 0) {
    return tables_with_web(program, std::move(links));
  }
  // Connected components of masses, joined by the links that move them.
  Groups groups(program.moving);
  std::vector<std::uint32_t> any(links.size(), no_mass);  // [link] A mass that it moves.
  // [node] A mass that it moves.
  std::vector<std::uint32_t> under(program.position.size(), no_mass);
  std::vector<std::uint8_t> is_known(under.size(), 0);
  for (std::size_t i = 0; i < links.size(); ++i) {
    for (const std::uint32_t end : {links[i].ends.a, links[i].ends.b}) {
      if (!std::exchange(is_known[end], 1)) {
        each_moved(program, end, [&](std::uint32_t node) {
          under[end] = under[end] == no_mass ? node : under[end];
          groups.join(under[end], node);
        });
      }
      if (under[end] != no_mass) {
        any[i] = any[i] == no_mass ? under[end] : any[i];
        groups.join(any[i], under[end]);
      }
    }
  }
  std::map<std::uint32_t, std::vector<std::size_t>> of_group;
  PassiveTables tables;
  for (std::size_t i = 0; i < links.size(); ++i) {
    if (any[i] == no_mass) {
      tables.links.push_back(links[i]);
    } else {
      of_group[groups.find(any[i])].push_back(i);
    }
  }
  for (const auto& [group, members] : of_group) {
    if (members.size() == 1) {
      tables.links.push_back(links[members[0]]);
    }
  }
  tables.alone = tables.links.size();
  for (const auto& [group, members] : of_group) {
    if (members.size() > 1) {
      tables.clusters.push_back({.first = static_cast<std::uint32_t>(tables.links.size()),
                                 .count = static_cast<std::uint32_t>(members.size())});
      for (const std::size_t i : members) {
        tables.links.push_back(links[i]);
      }
      find_elimination(program, tables.links, tables.clusters.back());
    }
  }
  return tables;
}

}  // namespace ressort::kernels
