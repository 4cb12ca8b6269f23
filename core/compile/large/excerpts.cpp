#include "core/compile/large/excerpts.h"

#include <algorithm>
#include <limits>
#include <map>
#include <memory>

#include "core/analysis/assembly.h"
#include "core/analysis/stability.h"
#include "core/compile/cull.h"
#include "core/groups.h"
#include "core/kernels/domains/halos.h"
#include "core/kernels/domains/sharded_form.h"
#include "core/kernels/domains/shards.h"
#include "core/kernels/registry.h"
#include "core/kernels/taps.h"
#include "core/model/topology.h"

namespace ressort::compile {
namespace {

constexpr std::uint64_t least_nodes = 100'000;  // of macros: below, all of it is soon written out
constexpr std::size_t most_single_elements = 4096;  // every shard looks at them
constexpr std::uint32_t excerpt_nodes = 4096;       // of a macro at least
constexpr std::uint32_t rows_around = 3;            // with all that the edge bound sees at a place
constexpr std::size_t most_shards = 1024;
constexpr std::uint64_t most_at_once = 1'000'000;  // nodes that are written out for one shard

using Ranges = std::vector<std::vector<NodeRange>>;  // [macro]

// How much farther in its numbers a macro's node is that is one link away, at most.
std::uint64_t step_of(const Macro& macro) {
  return macro.width > 1                         ? std::uint64_t{macro.width} + 1
         : macro.kind == MacroKind::stiff_string ? 2
                                                 : 1;
}

void add_around(const Macro& macro, std::uint64_t first, std::uint64_t end, std::uint64_t reach,
                std::vector<NodeRange>& ranges) {
  ranges.push_back(
      {static_cast<std::uint32_t>(first - std::min(first, reach)),
       static_cast<std::uint32_t>(std::min<std::uint64_t>(node_count(macro), end + reach))});
}

// Ascending, and what is near each other in one, so that no place lies across two.
void tidy(const Macro& macro, std::vector<NodeRange>& ranges) {
  std::sort(ranges.begin(), ranges.end(),
            [](const NodeRange& a, const NodeRange& b) { return a.first < b.first; });
  std::vector<NodeRange> joined;
  for (const NodeRange& range : ranges) {
    if (joined.empty() || range.first > joined.back().end + 2 * std::uint64_t{macro.width} + 2) {
      joined.push_back(range);
    } else {
      joined.back().end = std::max(joined.back().end, range.end);
    }
  }
  ranges = std::move(joined);
}

// The nodes around a place that stays, of its macro, [first, end): in either precision.
NodeRange around(const Network& network, const Tap& tap) {
  const Macro& macro = network.macros[tap.macro];
  const TapSlot slot{.length = macro.length, .width = macro.width};
  NodeRange nodes{0xffffffffu, 0};
  const auto add = [&](std::uint32_t node, auto) {
    nodes = {std::min(nodes.first, node), std::max(nodes.end, node + 1)};
  };
  const double u = argument_value(network, tap.u, {});
  const double v = argument_value(network, tap.v, {});
  each_corner(corners_at(slot, u, v), add);
  each_corner(corners_at(slot, static_cast<float>(u), static_cast<float>(v)), add);
  return nodes;
}

bool has_steady_places(const Network& network) {
  const auto is_steady = [&](ArgumentId id) {
    return id == no_argument || is_constant(network.arguments[id]);
  };
  return std::all_of(network.taps.begin(), network.taps.end(),
                     [&](const Tap& tap) { return is_steady(tap.u) && is_steady(tap.v); });
}

// Places with some rows around them, and each macro's first nodes where that is not enough.
Ranges ranges_for_all(const Network& network) {
  Ranges ranges(network.macros.size());
  for (const Tap& tap : network.taps) {
    const Macro& macro = network.macros[tap.macro];
    const NodeRange nodes = around(network, tap);
    add_around(macro, nodes.first, nodes.end, rows_around * step_of(macro), ranges[tap.macro]);
  }
  for (std::size_t i = 0; i < ranges.size(); ++i) {
    const Macro& macro = network.macros[i];
    const std::uint64_t least =
        std::max<std::uint64_t>(excerpt_nodes, std::uint64_t{2} * rows_around * macro.width);
    if (ranges[i].empty()) {
      ranges[i].push_back({});
    }
    add_around(macro, ranges[i][0].first, ranges[i][0].end, least, ranges[i]);
    tidy(macro, ranges[i]);
  }
  return ranges;
}

bool is_surely_stable(const Network& network, std::span<const double> start, double rate_ratio) {
  const ParameterBox box{{start.begin(), start.end()}, {start.begin(), start.end()}};
  const std::vector<Range> arguments = argument_ranges(network, box);
  const bool pushes = std::any_of(arguments.begin(), arguments.end(),
                                  [](const Range& range) { return range.lowest < 0.0; });
  return !pushes && highest_stiffness_factor(always_felt(network), box, rate_ratio) >= 1.0;
}

// An excerpt's masses, as macros' nodes or by the numbers of the whole.
class Numbers {
 public:
  Numbers(const Network& written, const Ranges& ranges)
      : ranges_(ranges), wholes_(macro_starts(written)) {
    auto next = static_cast<std::uint32_t>(written.masses.size());
    for (const auto& of_macro : ranges) {
      starts_.push_back(next);
      for (const NodeRange& range : of_macro) {
        next += range.end - range.first;
      }
    }
  }

  // In the whole network with its macros written out.
  std::uint32_t in_whole(std::uint32_t mass) const {
    if (starts_.empty() || mass < starts_[0]) {
      return mass;
    }
    const auto macro = static_cast<std::size_t>(
        std::upper_bound(starts_.begin(), starts_.end(), mass) - starts_.begin() - 1);
    std::uint32_t at = mass - starts_[macro];
    for (const NodeRange& range : ranges_[macro]) {
      if (at < range.end - range.first) {
        return wholes_[macro] + range.first + at;
      }
      at -= range.end - range.first;
    }
    return nobody;
  }

 private:
  const Ranges& ranges_;
  const std::vector<std::uint32_t> wholes_;  // [macro] its first mass in the whole
  std::vector<std::uint32_t> starts_;        // and in the excerpt
};

// Who has which of the whole network's masses, and how each shard is made.
class Dealer {
 public:
  struct Way {
    std::uint32_t count = 1;
    std::uint32_t frames = 4;
  };

  // `excerpt`: of it `share` is played, as `whole`.
  Dealer(const Network& written, const Network& excerpt, const Share& share, const Program& whole,
         std::vector<CoefficientKey> keys, bool rescale, const Way& way)
      : written_(written),
        excerpt_(excerpt),
        share_(share),
        whole_(whole),
        keys_(std::move(keys)),
        rescale_(rescale),
        way_(way),
        starts_(macro_starts(written)),
        singles_(static_cast<std::uint32_t>(written.masses.size())),
        groups_(singles_),
        owner_(singles_, nobody) {
    for (const Macro& macro : written.macros) {
      nodes_ += node_count(macro);
    }
    find_places();
    find_owners();
    for (std::uint32_t shard = 0; shard < way_.count; ++shard) {
      ranges_.push_back(ranges_of(shard));
    }
  }

  // Shards [first, end) whole; of others what they give to these, and what is heard of them.
  std::vector<Shard> make(std::uint32_t first, std::uint32_t end, const Progress& progress) const {
    const std::vector<bool> is_known = known_to(first, end);
    std::vector<Shard> shards(way_.count);
    for (std::uint32_t s = 0; s < way_.count; ++s) {
      if (is_known[s]) {
        progress.spend(64 * (nodes_ / way_.count));
        shards[s] = make_one(s);
      }
      if (s < first || s >= end) {
        shards[s].program = {};
        shards[s].inputs.clear();
      }
      shards[s].outputs.clear();
    }
    for (std::uint32_t i = 0; i < whole_.outputs.size(); ++i) {
      const std::uint32_t owner = owner_[whole_.masses[whole_.outputs[i].node]];
      shards[owner == nobody ? 0 : owner].outputs.push_back(i);
    }
    join_halos(shards, [&](std::uint32_t mass) { return owner_of(mass); });
    call_as_in_excerpt(shards);
    return shards;
  }

 private:
  bool is_place(std::uint32_t mass) const { return excerpt_.masses[mass].kind == MassKind::point; }
  std::uint32_t macro_of(std::uint32_t place) const {
    return excerpt_.taps[excerpt_.masses[place].tap].macro;
  }

  // All nodes of macros stand in one row, of which each shard has a part.
  std::uint32_t shard_at(std::uint64_t at) const {
    return static_cast<std::uint32_t>(at * way_.count / nodes_);
  }
  std::uint64_t first_of(std::uint64_t shard) const {
    return (shard * nodes_ + way_.count - 1) / way_.count;
  }
  std::uint32_t owner_of(std::uint32_t mass) const {
    if (mass < singles_) {
      return owner_[mass];
    }
    const auto macro = static_cast<std::size_t>(
        std::upper_bound(starts_.begin(), starts_.end(), mass) - starts_.begin() - 1);
    return is_fixed(written_.macros[macro], mass - starts_[macro]) ? nobody
                                                                   : shard_at(mass - singles_);
  }

  // Who moves, stands for who does, or is heard as a force has an owner; links join these alone.
  void find_places() {
    for (const std::uint32_t i : share_.masses) {
      if (i < singles_ && (moves(excerpt_.masses[i]) || is_place(i))) {
        owner_[i] = 0;
      }
      if (i < singles_ && is_place(i)) {
        places_[i] = around(written_, excerpt_.taps[excerpt_.masses[i].tap]);
      }
    }
    for (const Output& output : excerpt_.outputs) {
      owner_[output.mass] = output.is_force ? 0 : owner_[output.mass];
    }
    for (std::size_t l = 0; l < written_.links.size(); ++l) {
      const Link& link = excerpt_.links[l];
      if (owner_[link.a] != nobody && owner_[link.b] != nobody) {
        groups_.join(link.a, link.b);
      }
    }
  }

  // A place is whose its first node is that moves; what places hold is whose the first of them is.
  void find_owners() {
    std::map<std::uint32_t, std::uint32_t> of_group;
    for (const auto& [place, nodes] : places_) {
      const std::uint32_t first = starts_[macro_of(place)];
      for (std::uint32_t node = nodes.end; node-- > nodes.first;) {
        const std::uint32_t owner = owner_of(first + node);
        owner_[place] = owner != nobody ? owner : owner_[place];
      }
      of_group.try_emplace(groups_.find(place), owner_[place]);
    }
    for (std::uint32_t i = 0; i < singles_; ++i) {
      const auto group = of_group.find(groups_.find(i));
      if (owner_[i] != nobody && !is_place(i) && group != of_group.end()) {
        owner_[i] = group->second;
      }
    }
  }

  // What a shard's own can feel in time, and a little more: around its part of the row, and
  // wherever else that is held.
  Ranges ranges_of(std::uint32_t shard) {
    const std::uint64_t levels = way_.frames + spare_levels + 1;
    const std::uint64_t first = first_of(shard);
    const std::uint64_t end = first_of(std::uint64_t{shard} + 1);
    Ranges ranges(written_.macros.size());
    for (std::size_t i = 0; i < ranges.size(); ++i) {
      const Macro& macro = written_.macros[i];
      const std::uint64_t begin = starts_[i] - singles_;
      const std::uint64_t from = std::max(first, begin);
      const std::uint64_t to = std::min(end, begin + node_count(macro));
      if (from < to) {
        add_around(macro, from - begin, to - begin, levels * step_of(macro), ranges[i]);
      }
    }
    std::vector<bool> is_held(singles_);  // [group]
    for (std::uint32_t i = 0; i < singles_; ++i) {
      is_held[groups_.find(i)] = is_held[groups_.find(i)] || owner_[i] == shard;
    }
    for (std::size_t held = 0, before = 1; held != before;) {
      before = held;
      held = 0;
      for (const auto& [place, nodes] : places_) {
        const std::uint32_t i = macro_of(place);
        const std::uint32_t group = groups_.find(place);
        is_held[group] = is_held[group] || touches(ranges[i], nodes);
        if (is_held[group]) {
          ++held;
          add_around(written_.macros[i], nodes.first, nodes.end,
                     levels * step_of(written_.macros[i]), ranges[i]);
        }
      }
      for (std::size_t i = 0; i < ranges.size(); ++i) {
        tidy(written_.macros[i], ranges[i]);
      }
    }
    return ranges;
  }

  static bool touches(const std::vector<NodeRange>& ranges, const NodeRange& nodes) {
    return std::any_of(ranges.begin(), ranges.end(), [&](const NodeRange& range) {
      return range.first < nodes.end && nodes.first < range.end;
    });
  }
  static bool holds(const std::vector<NodeRange>& ranges, const NodeRange& nodes) {
    return std::any_of(ranges.begin(), ranges.end(), [&](const NodeRange& range) {
      return range.first <= nodes.first && nodes.end <= range.end;
    });
  }

  // Whether what one shard is made from holds nodes that are another's own.
  bool sees(std::uint32_t shard, std::uint32_t other) const {
    for (std::size_t i = 0; i < written_.macros.size(); ++i) {
      const std::uint64_t begin = starts_[i] - singles_;
      const std::uint64_t from = std::max(first_of(other), begin);
      const std::uint64_t to =
          std::min(first_of(std::uint64_t{other} + 1), begin + node_count(written_.macros[i]));
      if (from < to && touches(ranges_[shard][i], {static_cast<std::uint32_t>(from - begin),
                                                   static_cast<std::uint32_t>(to - begin)})) {
        return true;
      }
    }
    return false;
  }

  // These shards, those that copy of them or give to them, and whoever copies of those that give.
  std::vector<bool> known_to(std::uint32_t first, std::uint32_t end) const {
    std::vector<bool> is_near(way_.count, false);
    for (std::uint32_t s = first; s < end; ++s) {
      for (std::uint32_t other = 0; other < way_.count; ++other) {
        is_near[other] = is_near[other] || s == other || sees(s, other) || sees(other, s);
      }
    }
    std::vector<bool> is_known = is_near;
    for (std::uint32_t s = 0; s < way_.count; ++s) {
      for (std::uint32_t other = 0; !is_known[s] && other < way_.count; ++other) {
        is_known[s] = is_near[other] && sees(s, other);
      }
    }
    return is_known;
  }

  // What of the network is played where only these ranges are.
  Share share_of(const Network& network, const Ranges& ranges) const {
    Share share;
    std::vector<bool> is_here(network.masses.size(), true);
    std::fill_n(is_here.begin(), singles_, false);
    for (const std::uint32_t i : share_.masses) {
      if (i < singles_) {
        is_here[i] = !is_place(i) || holds(ranges[macro_of(i)], places_.at(i));
      }
    }
    for (std::uint32_t i = 0; i < is_here.size(); ++i) {
      if (is_here[i]) {
        share.masses.push_back(i);
      }
    }
    const auto add = [&](std::uint32_t l) {
      if (is_here[network.links[l].a] && is_here[network.links[l].b]) {
        share.links.push_back(l);
      }
    };
    for (const std::uint32_t l : share_.links) {
      if (l < written_.links.size()) {
        add(l);
      }
    }
    for (std::size_t l = written_.links.size(); l < network.links.size(); ++l) {
      add(static_cast<std::uint32_t>(l));
    }
    return share;
  }

  // By the numbers of the whole network.
  Shard make_one(std::uint32_t s) const {
    const Network network = expand_excerpt(written_, ranges_[s]);
    Program program =
        tabulate_part(network, share_of(network, ranges_[s]), keys_, whole_.rate_hz, rescale_)
            .program;
    const Numbers numbers(written_, ranges_[s]);
    std::vector<std::uint32_t> owner;
    for (std::uint32_t& mass : program.masses) {
      mass = numbers.in_whole(mass);
      owner.push_back(owner_of(mass));
    }
    Shard shard = make_shard(program, std::move(owner), s, way_.frames).value_or(Shard());
    for (std::uint32_t& node : shard.nodes) {
      node = program.masses[node];
    }
    shard.inputs.clear();
    for (const InputSlot& input : shard.program.inputs) {
      const auto same = [&](const InputSlot& other) { return other.input == input.input; };
      shard.inputs.push_back(static_cast<std::uint32_t>(
          std::find_if(whole_.inputs.begin(), whole_.inputs.end(), same) - whole_.inputs.begin()));
    }
    return shard;
  }

  void call_as_in_excerpt(std::vector<Shard>& shards) const {
    std::map<std::uint32_t, std::uint32_t> known;  // mass of the whole -> node of the excerpt
    for (std::uint32_t node = 0; node < whole_.masses.size(); ++node) {
      if (whole_.masses[node] < singles_) {
        known[whole_.masses[node]] = node;
      }
    }
    for (Shard& shard : shards) {
      std::map<std::uint32_t, std::uint32_t> local;
      for (std::uint32_t i = 0; i < shard.nodes.size(); ++i) {
        if (shard.nodes[i] < singles_) {
          local[known.at(shard.nodes[i])] = i;
        }
      }
      shard.nodes = {};
      for (const auto& [node, at] : local) {
        shard.nodes.push_back(node);
        shard.local.push_back(at);
      }
    }
  }

  const Network& written_;
  const Network& excerpt_;
  const Share& share_;
  const Program& whole_;
  const std::vector<CoefficientKey> keys_;
  const bool rescale_;
  const Way way_;
  const std::vector<std::uint32_t> starts_;    // [macro] its first mass, in the whole
  const std::uint32_t singles_;                // masses that are no macro's come before
  std::uint64_t nodes_ = 0;                    // of all macros
  Groups groups_;                              // of single masses, by their links
  std::vector<std::uint32_t> owner_;           // [single mass] shard, or nobody
  std::map<std::uint32_t, NodeRange> places_;  // by their masses: the nodes around them
  std::vector<Ranges> ranges_;                 // [shard] what it is made from
};

// The excerpt as if it had so many nodes, for what they cost.
double ns_of(const Program& excerpt, std::uint64_t nodes, const Workload& load) {
  Program program = excerpt;
  program.form = Direct{};
  const double times = static_cast<double>(nodes) / excerpt.moving;
  const auto grown = [&](std::size_t count) {
    return static_cast<std::uint32_t>(static_cast<double>(count) * times);
  };
  program.moving = grown(program.moving);
  program.ends.resize(grown(program.ends.size()));
  for (LinkRun& run : program.link_runs) {
    run.count = grown(run.count);
  }
  return predicted_ns(program, load);
}

// In the second cache or not, whichever is predicted to be faster.
Dealer::Way best_way(const Network& written, const Program& excerpt, std::uint64_t nodes,
                     const Workload& load) {
  const std::size_t workers = load.executor->size();
  std::uint64_t step = 1;
  for (const Macro& macro : written.macros) {
    step = std::max<std::uint64_t>(step, macro.width > 1 ? macro.width : step_of(macro));
  }
  const std::size_t few = workers * ((nodes / workers + most_at_once - 1) / most_at_once);
  Dealer::Way best;
  double least_ns = std::numeric_limits<double>::infinity();
  for (const std::size_t count : {few, shards_in(second_cache, nodes, load, most_shards)}) {
    if (count < few) {
      continue;
    }
    std::vector<std::size_t> at_level(most_levels + 1, count > 1 ? 2 * step : 0);
    at_level[0] = nodes / count;
    const std::vector<std::vector<std::size_t>> all(count, at_level);
    const double ns = ns_of(excerpt, at_level[0], load) / static_cast<double>(at_level[0]);
    if (const Meeting meeting = best_meeting(all, ns, workers); meeting.ns < least_ns) {
      least_ns = meeting.ns;
      best = {static_cast<std::uint32_t>(count), meeting.frames};
    }
  }
  return best;
}

}  // namespace

std::optional<Excerpts> Excerpts::of(const Network& written, std::span<const double> start,
                                     double rate_ratio) {
  Excerpts found;
  std::uint64_t nodes = 0;
  for (const Macro& macro : written.macros) {
    if (macro.kind == MacroKind::body || is_waveguide(macro.kind)) {
      return std::nullopt;
    }
    nodes += node_count(macro);
    found.links_ += link_count(macro);
  }
  if (nodes < least_nodes || !has_steady_places(written) ||
      written.masses.size() + written.links.size() > most_single_elements) {
    return std::nullopt;
  }
  found.written_ = &written;
  found.masses_ = moving_count(written);
  for (const Macro& macro : written.macros) {
    for (std::uint32_t node = 0; node < node_count(macro); ++node) {
      found.masses_ += is_fixed(macro, node) ? 0 : 1;
    }
  }
  found.links_ += written.links.size();
  found.ranges_ = ranges_for_all(written);
  found.network_ = expand_excerpt(written, found.ranges_);
  Network started = found.network_;
  for (std::size_t i = 0; i < start.size(); ++i) {
    started.parameters[i].value = start[i];
  }
  const Culled culled = cull(found.network_);
  const std::vector<Share> shares = divide(found.network_, culled);
  const bool is_all = shares.size() == 1 && culled.unheard == 0 && culled.idle == 0;
  if (!is_all || !is_surely_stable(started, start, rate_ratio)) {
    return std::nullopt;
  }
  found.share_ = shares[0];
  return found;
}

Shards Excerpts::share_out(const Program& excerpt, const Workload& load, bool rescale,
                           const Progress& progress) const {
  Dealer::Way way = best_way(*written_, excerpt, masses_, load);
  Fellows* const fellows = load.executor->fellows();
  if (fellows != nullptr) {
    std::uint32_t numbers[] = {0, way.count, way.frames};
    fellows->follow_first(numbers);
    way = {numbers[1], numbers[2]};
  }
  const auto workers = static_cast<std::uint32_t>(load.executor->size());
  const std::uint32_t own = fellows != nullptr ? static_cast<std::uint32_t>(fellows->own()) : 0;
  const std::uint32_t each = fellows != nullptr ? way.count / workers : way.count;
  Tabulated whole = tabulate_part(network_, share_, {}, excerpt.rate_hz, rescale);
  const Dealer dealer(*written_, network_, share_, excerpt, std::move(whole.keys), rescale, way);
  return {.shards = std::make_shared<std::vector<Shard>>(
              dealer.make(own * each, (own + 1) * each, progress)),
          .executor = load.executor,
          .frames = way.frames,
          .is_excerpt = true};
}

}  // namespace ressort::compile
