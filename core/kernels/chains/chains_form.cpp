#include "core/kernels/chains/chains_form.h"

#include <algorithm>
#include <array>

#include "core/kernels/chains/chains.h"
#include "core/kernels/estimates.h"
#include "core/kernels/passive/clusters.h"
#include "core/kernels/taps.h"
#include "core/laws/law.h"

namespace ressort::kernels {
namespace {

constexpr std::uint32_t none = 0xffffffffu;

bool is_spring(const LinkRun& run) {
  return is_linear(run.law) && run.scheme == Scheme::plain;
}

class ChainFinder {
 public:
  ChainFinder(const Program& program, const Progress& progress)
      : program_(program),
        progress_(progress),
        mass_run_(program.position.size(), none),
        can_hold_(program.position.size(), true),
        run_of_(program.ends.size()),
        springs_at_(program.position.size()),
        near_(program.position.size()),
        is_chained_(program.moving, false),
        is_used_(program.ends.size(), false) {
    for (std::uint32_t run = 0; run < program.mass_runs.size(); ++run) {
      const MassRun& masses = program.mass_runs[run];
      std::fill_n(mass_run_.begin() + masses.first, masses.count, run);
      std::fill_n(can_hold_.begin() + masses.first, masses.count, false);
    }
    for (const TapSlot& tap : program.taps) {
      can_hold_[tap.node] = false;  // Its forces act on the nodes around it, too.
    }
    for (const LinkRun& run : program.link_runs) {
      for (std::uint32_t link = run.first; is_spring(run) && link < run.first + run.count; ++link) {
        run_of_[link] = &run;
        springs_at_[program.ends[link].a].push_back(link);
        springs_at_[program.ends[link].b].push_back(link);
      }
    }
  }

  std::optional<Chains> find() {
    struct Candidate {
      const LinkRun* run;
      std::size_t springs;
    };
    std::vector<Candidate> candidates;
    for (const LinkRun& run : program_.link_runs) {
      if (is_spring(run) && run.count + 1 >= least_chain_masses) {
        candidates.push_back({&run, search(run).springs.size()});
      }
    }
    std::stable_sort(candidates.begin(), candidates.end(),
                     [](const Candidate& a, const Candidate& b) { return a.springs > b.springs; });
    for (const Candidate& candidate : candidates) {
      take(search(*candidate.run));
    }
    if (form_.chains.empty()) {
      return std::nullopt;
    }
    for (std::uint32_t node = 0; node < program_.moving; ++node) {
      if (!is_chained_[node]) {
        form_.loose.push_back(node);
      }
    }
    for (std::uint32_t link = 0; link < program_.ends.size(); ++link) {
      if (!is_used_[link]) {
        form_.links.push_back(link);
      }
    }
    return std::move(form_);
  }

 private:
  // The springs of one run at a node.
  struct Near {
    std::uint32_t degree = 0;
    std::array<std::uint32_t, 2> springs{none, none};  // Springs that may be part of a chain.
    std::uint32_t holder = none;                       // A spring to a fixed node.
    bool is_seen = false;
  };

  // The chains of one kind of spring, and the links that they would replace.
  struct Found {
    std::vector<Chain> chains;
    std::vector<std::uint32_t> nodes;
    std::vector<std::uint32_t> springs;
  };

  bool is_equal(const Ends& ends) const {
    const auto [a, b] = ends;
    return a != b && mass_run_[a] != none && mass_run_[a] == mass_run_[b] && !is_chained_[a] &&
           !is_chained_[b];
  }

  Found search(const LinkRun& run) {
    Found found;
    progress_.spend(6 * std::size_t{run.count});
    const auto each_spring = [&](auto&& use) {
      for (std::uint32_t link = run.first; link < run.first + run.count; ++link) {
        use(link, program_.ends[link]);
      }
    };
    each_spring([&](std::uint32_t, const Ends& ends) { near_[ends.a] = near_[ends.b] = {}; });
    each_spring([&](std::uint32_t link, const Ends& ends) {
      if (is_equal(ends)) {
        ++near_[ends.a].degree;
        ++near_[ends.b].degree;
      } else if (can_hold_[ends.a] != can_hold_[ends.b]) {
        near_[can_hold_[ends.a] ? ends.b : ends.a].holder = link;
      }
    });
    each_spring([&](std::uint32_t link, const Ends& ends) {
      Near& a = near_[ends.a];
      Near& b = near_[ends.b];
      if (is_equal(ends) && a.degree <= 2 && b.degree <= 2) {
        a.springs[a.springs[0] == none ? 0 : 1] = link;
        b.springs[b.springs[0] == none ? 0 : 1] = link;
      }
    });
    // Starts at chain ends. The rest are rings, which may be cut anywhere.
    for (const bool from_end : {true, false}) {
      each_spring([&](std::uint32_t, const Ends& ends) {
        for (const std::uint32_t node : {ends.a, ends.b}) {
          const Near& near = near_[node];
          if (!near.is_seen && near.springs[0] != none && (near.springs[1] == none) == from_end) {
            add_chain(run, node, found);
          }
        }
      });
    }
    return found;
  }

  void take(Found found) {
    for (Chain& chain : found.chains) {
      chain.first += static_cast<std::uint32_t>(form_.nodes.size());
      form_.chains.push_back(chain);
    }
    for (const std::uint32_t node : found.nodes) {
      is_chained_[node] = true;
    }
    for (const std::uint32_t spring : found.springs) {
      is_used_[spring] = true;
    }
    form_.nodes.insert(form_.nodes.end(), found.nodes.begin(), found.nodes.end());
  }

  void add_chain(const LinkRun& run, std::uint32_t node, Found& found) {
    std::vector<std::uint32_t> row;
    std::vector<std::uint32_t> springs;
    while (node != none) {
      near_[node].is_seen = true;
      row.push_back(node);
      std::uint32_t next = none;
      for (const std::uint32_t spring : near_[node].springs) {
        if (next == none && spring != none && !near_[other(spring, node)].is_seen) {
          springs.push_back(spring);
          next = other(spring, node);
        }
      }
      node = next;
    }
    if (row.size() < least_chain_masses) {
      return;
    }
    std::uint32_t left = held_by(near_[row.front()].holder, row.front(), springs);
    std::uint32_t right = held_by(near_[row.back()].holder, row.back(), springs);
    if (is_fixed_ground(program_, left) && !is_fixed_ground(program_, right)) {
      std::swap(left, right);
      std::reverse(row.begin(), row.end());
    }
    Chain chain{.first = static_cast<std::uint32_t>(found.nodes.size()),
                .count = static_cast<std::uint32_t>(row.size()),
                .mass_run = mass_run_[row[0]],
                .stiffness = run.coefficients[0],
                .damping = run.coefficients[1],
                .left = left,
                .right = right};
    stiffen(run, row, chain, springs);
    found.chains.push_back(chain);
    found.nodes.insert(found.nodes.end(), row.begin(), row.end());
    found.springs.insert(found.springs.end(), springs.begin(), springs.end());
  }

  // Returns the node that holds a chain's end, and adds its spring to `springs`.
  std::uint32_t held_by(std::uint32_t spring, std::uint32_t node,
                        std::vector<std::uint32_t>& springs) const {
    if (spring == none) {
      return Chain::free;
    }
    springs.push_back(spring);
    return other(spring, node);
  }

  // Adds the second springs, from each mass of a row to the next but one, if all of them exist.
  void stiffen(const LinkRun& run, const std::vector<std::uint32_t>& row, Chain& chain,
               std::vector<std::uint32_t>& springs) const {
    constexpr int most_tries = 8;
    int tries = 0;
    for (const std::uint32_t first : springs_at_[row[0]]) {
      if (row.size() < 3 || other(first, row[0]) != row[2] || is_used_[first] ||
          ++tries > most_tries) {
        continue;
      }
      const LinkRun& second = *run_of_[first];
      std::vector<std::uint32_t> used;
      for (std::size_t i = 0; i + 2 < row.size() && used.size() == i; ++i) {
        const std::uint32_t spring =
            spring_at(row[i], second, [&](std::uint32_t node) { return node == row[i + 2]; });
        if (spring != none) {
          used.push_back(spring);
        }
      }
      if (&second == &run || used.size() + 2 != row.size()) {
        continue;
      }
      chain.is_stiff = true;
      chain.second_stiffness = second.coefficients[0];
      chain.second_damping = second.coefficients[1];
      const auto holder = [&](std::uint32_t node) {
        const auto can_hold = [&](std::uint32_t end) { return bool{can_hold_[end]}; };
        return held_by(spring_at(node, second, can_hold), node, used);
      };
      chain.second_left = {holder(row[0]), holder(row[1])};
      chain.second_right = {holder(row.back()), holder(row[row.size() - 2])};
      springs.insert(springs.end(), used.begin(), used.end());
      return;
    }
  }

  // Returns a spring of one run from a node to a node that satisfies the predicate.
  template <class IsAskedFor>
  std::uint32_t spring_at(std::uint32_t node, const LinkRun& run, IsAskedFor&& is_asked_for) const {
    progress_.spend(springs_at_[node].size());
    for (const std::uint32_t spring : springs_at_[node]) {
      if (run_of_[spring] == &run && !is_used_[spring] && is_asked_for(other(spring, node))) {
        return spring;
      }
    }
    return none;
  }

  std::uint32_t other(std::uint32_t link, std::uint32_t node) const {
    const Ends& ends = program_.ends[link];
    return ends.a == node ? ends.b : ends.a;
  }

  const Program& program_;
  const Progress& progress_;
  std::vector<std::uint32_t> mass_run_;  // [node] none: it does not move.
  std::vector<bool> can_hold_;           // [node] True for grounds and position inputs.
  std::vector<const LinkRun*> run_of_;   // [link] Set for springs.
  std::vector<std::vector<std::uint32_t>> springs_at_;  // [node] Links.
  std::vector<Near> near_;                              // [node]
  std::vector<bool> is_chained_;                        // [moving node]
  std::vector<bool> is_used_;                           // [link]
  Chains form_;
};

// Returns whether the form is a single chain with an end on a ground, and nothing needs to see all
// of it in each sample.
bool is_simple(const Program& program, const Chains& form) {
  const Chain& chain = form.chains[0];
  const MassRun& mass = program.mass_runs[chain.mass_run];
  const auto is_force = [](const OutputSlot& output) { return output.is_force; };
  return form.chains.size() == 1 && !chain.is_stiff && !mass.is_oscillator && !mass.has_gravity &&
         program.taps.empty() && is_plain(program) && is_fixed_ground(program, chain.right) &&
         std::none_of(program.outputs.begin(), program.outputs.end(), is_force);
}

// Returns the smallest number of packs that has a step in registers, or 0.
template <std::size_t... counts>
std::size_t short_packs(std::size_t least, std::size_t most, std::index_sequence<counts...>) {
  std::size_t packs = 0;
  static_cast<void>(((counts >= least && counts <= most && (packs = counts, true)) || ...));
  return packs;
}

}  // namespace

bool is_fixed_ground(const Program& program, std::uint32_t node) {
  return node != Chain::free &&
         std::none_of(program.inputs.begin(), program.inputs.end(),
                      [&](const InputSlot& input) { return input.node == node; });
}

FoldedBy fold_by(const Program& program, const Chains& form, Isa isa, std::size_t number_bytes) {
  const std::size_t whole = whole_pack_bytes(isa) / number_bytes;
  std::uint32_t longest = 0;
  std::uint32_t shortest_stiff = nowhere;
  for (const Chain& chain : form.chains) {
    longest = std::max(longest, chain.count);
    shortest_stiff = chain.is_stiff ? std::min(shortest_stiff, chain.count) : shortest_stiff;
  }
  // Uses the widest packs if there are enough registers for the whole chain.
  if (is_simple(program, form)) {
    const std::size_t most = isa == Isa::v4 ? 13 : 8;
    const std::size_t packs = short_packs((longest + whole - 1) / whole, most, ShortPacks{});
    if (packs > 0) {
      return {whole, packs};
    }
  }
  // Uses the widest packs for which the longest chain has enough passes to outweigh the cost at its
  // ends. In a stiff chain a mass and the next but one must be in different pairs.
  std::size_t lanes = whole;
  while (lanes > 16 / number_bytes && (longest < 3 * lanes || shortest_stiff <= lanes)) {
    lanes /= 2;
  }
  return {lanes, 0};
}

std::optional<Chains> chains_form(const Program& program, const Progress& progress) {
  const auto is_force = [](const OutputSlot& output) { return output.is_force; };
  if ((!program.taps.empty() || !is_plain(program)) &&
      std::any_of(program.outputs.begin(), program.outputs.end(), is_force)) {
    return std::nullopt;  // The force of a point or a passive link on a node is never summed.
  }
  if (holds_places(program) || has_bodies(program)) {
    return std::nullopt;
  }
  progress.spend(4 * program.ends.size());
  return ChainFinder(program, progress).find();
}

// Counts per voice: a chain that stays in registers costs three operations a pack of masses; one in
// memory costs the same plus the work at its ends. All other elements are stepped one by one.
double operations(const Program& program, const Chains& form, const Workload& load) {
  const FoldedBy by = fold_by(program, form, load.isa, load.is_double ? 8 : 4);
  double count = 0.0;
  if (by.short_packs > 0) {
    count += 20.0 + 3.0 * static_cast<double>(by.short_packs);
  } else {
    count += 24.0;
    for (const Chain& chain : form.chains) {
      const double packs = std::ceil(chain.count / static_cast<double>(by.lanes));
      count += 8.0 + 3.0 * packs + (chain.is_stiff ? 96.0 + 5.0 * packs : 0.0);
    }
    const double bytes = 2.0 * bytes_of_number(load) * static_cast<double>(form.nodes.size());
    count += 1.5 * lines_of(bytes) + 6.0 * far_lines_of(bytes);
  }
  count += form.links.empty() ? 0.0 : 16.0;
  for (const std::uint32_t link : form.links) {
    const auto run =
        std::find_if(program.link_runs.begin(), program.link_runs.end(),
                     [&](const LinkRun& r) { return link >= r.first && link < r.first + r.count; });
    count += run->scheme == Scheme::plain ? 11.0 : 0.0;
  }
  return load.voices *
         (count + 13.0 * static_cast<double>(form.loose.size()) +
          static_cast<double>(program.inputs.size() + program.outputs.size()) +
          80.0 * static_cast<double>(program.taps.size()) + passive_operations(program));
}

std::string description(const Program&, const Chains& form) {
  return count_of(form.chains.size(), "row of equal masses", "rows of equal masses") +
         " folded into vectors, " + count_of(form.loose.size(), "mass", "masses") + " and " +
         count_of(form.links.size(), "link", "links") + " one by one";
}

std::uint64_t voice_bytes(const Program& program, const Chains& form, std::uint64_t number_bytes) {
  return bytes_with_own_links(program, form.links.size(), number_bytes);
}

}  // namespace ressort::kernels
