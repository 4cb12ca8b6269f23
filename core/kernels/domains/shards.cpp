#include "core/kernels/domains/shards.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/kernels/chains/chains_form.h"
#include "core/kernels/direct/direct_form.h"
#include "core/kernels/domains/bonds.h"
#include "core/kernels/domains/halos.h"
#include "core/kernels/domains/one_by_one.h"
#include "core/kernels/domains/sharded_form.h"
#include "core/kernels/grid/grid_form.h"
#include "core/kernels/registry.h"

namespace ressort::kernels {
namespace {

constexpr double least_shared_ns = 700.0;  // Smaller networks would wait longer than they compute.
constexpr std::size_t most_shards = 1024;
constexpr double least_gain = 1.2;  // Least speed-up that justifies another core.

// The owner of each node, and the number of nodes at each distance from a shard's own.
struct Division {
  std::vector<std::uint32_t> owner;  // [node] Shard; nobody for nodes that are not binding.
  std::vector<std::vector<std::uint32_t>> own;     // [shard] Its nodes, ascending.
  std::vector<std::vector<std::size_t>> at_level;  // [shard][level] Own nodes are at level 0.
};

std::vector<std::vector<std::uint32_t>> owned(const std::vector<std::uint32_t>& owner,
                                              std::size_t count) {
  std::vector<std::vector<std::uint32_t>> own(count);
  for (std::uint32_t node = 0; node < owner.size(); ++node) {
    if (owner[node] != nobody) {
      own[owner[node]].push_back(node);
    }
  }
  return own;
}

// Divides the nodes in their numbered order, or breadth first from the first one.
Division divide(const Bonds& bonds, std::size_t count, bool is_breadth_first) {
  std::vector<std::uint32_t> order = is_breadth_first ? bonds.breadth_first() : bonds.as_written();
  Division division{
      .owner = std::vector<std::uint32_t>(bonds.node_count(), nobody), .own = {}, .at_level = {}};
  for (std::size_t i = 0; i < order.size(); ++i) {
    division.owner[order[i]] = static_cast<std::uint32_t>(i * count / order.size());
  }
  for (const TapSlot& tap : bonds.program().taps) {
    const auto& corners = bonds.corners(tap.node);
    const auto first = std::find_if(corners.begin(), corners.end(),
                                    [&](std::uint32_t node) { return bonds.binds(node); });
    division.owner[tap.node] = first == corners.end() ? 0 : division.owner[*first];
  }
  division.own = owned(division.owner, count);
  std::vector<bool> is_seen(bonds.node_count(), false);
  for (const std::vector<std::uint32_t>& own : division.own) {
    const Surroundings around = bonds.surroundings(own, most_levels, is_seen);
    auto& at_level = division.at_level.emplace_back();
    for (std::size_t level = 0; level <= most_levels; ++level) {
      at_level.push_back(around.count_at(level));
    }
  }
  return division;
}

// Makes one shard after the other in time proportional to its nodes and links.
class Maker {
 public:
  Maker(const Bonds& bonds, const std::vector<std::uint32_t>& owner, std::uint32_t frames)
      : bonds_(bonds),
        program_(bonds.program()),
        owner_(owner),
        frames_(frames),
        is_here_(owner.size(), false),
        local_(owner.size(), nobody) {}

  void make(std::uint32_t s, const std::vector<std::uint32_t>& own, Shard& shard) {
    find_nodes(s, own, shard.nodes);
    Program& program = shard.program;
    program.rate_hz = program_.rate_hz;
    program.rate_ratio = program_.rate_ratio;
    program.audio_parameters = program_.audio_parameters;
    program.audio_coefficients = program_.audio_coefficients;
    program.parameters = program_.parameters;
    program.steps = program_.steps;
    program.coefficients = program_.coefficients;
    program.depending = program_.depending;
    for (std::uint32_t i = 0; i < shard.nodes.size(); ++i) {
      const std::uint32_t node = shard.nodes[i];
      local_[node] = i;
      program.position.push_back(program_.position[node]);
      program.velocity.push_back(program_.velocity[node]);
      program.moving += node < program_.moving ? 1 : 0;
    }
    take_mass_runs(shard.nodes, program);
    take_link_runs(shard.nodes, program);
    take_taps(program);
    take_inputs(shard);
    take_outputs(s, shard);
    for (const std::uint32_t node : shard.nodes) {
      local_[node] = nobody;
      is_here_[node] = false;
    }
  }

 private:
  void add(std::uint32_t node, std::vector<std::uint32_t>& nodes) {
    if (!is_here_[node]) {
      is_here_[node] = true;
      nodes.push_back(node);
    }
  }

  // A point needs all nodes around it. If one of them is owned, the others are within the halo.
  bool has_corners(std::uint32_t point) const {
    bool has_all = true;
    bonds_.each_behind(point, [&](std::uint32_t corner) { has_all = has_all && is_here_[corner]; });
    return has_all;
  }

  // Fixed nodes go to every shard that touches them. The first shard takes those that no shard
  // touches, and their outputs.
  void find_nodes(std::uint32_t s, const std::vector<std::uint32_t>& own,
                  std::vector<std::uint32_t>& nodes) {
    // Uses marks of its own, because distant nodes seen by outputs need not be in the shard.
    const Surroundings around = bonds_.surroundings(own, frames_ + spare_levels, is_here_);
    for (const std::uint32_t node : around.nodes) {
      if (!bonds_.is_point(node)) {
        add(node, nodes);
      }
    }
    for (std::uint32_t node = 0; s == 0 && node < is_here_.size(); ++node) {
      if (!bonds_.binds(node) && !bonds_.is_tied(node) && !bonds_.is_point(node)) {
        add(node, nodes);
      }
    }
    std::vector<std::uint32_t> points;
    for (const TapSlot& tap : program_.taps) {
      if (has_corners(tap.node)) {
        points.push_back(tap.node);
      }
    }
    for (const std::uint32_t point : points) {
      add(point, nodes);
      for (const std::uint32_t corner : bonds_.corners(point)) {
        add(corner, nodes);
      }
    }
    for (std::size_t i = 0, reached = nodes.size(); i < reached; ++i) {
      if (bonds_.binds(nodes[i])) {
        bonds_.each_link(nodes[i], [&](std::uint32_t link) {
          const auto [a, b] = program_.ends[link];
          const std::uint32_t other = a == nodes[i] ? b : a;
          if (!bonds_.binds(other)) {
            add(other, nodes);
          }
        });
      }
    }
    for (const OutputSlot& output : program_.outputs) {
      if (s == 0 && !bonds_.binds(output.node)) {
        add(output.node, nodes);
      }
    }
    std::sort(nodes.begin(), nodes.end());
  }

  // Calls use(run, first, end) for the runs of these places, ascending, with their range in
  // `places`.
  template <class Run, class Use>
  static void each_run(const std::vector<Run>& runs, const std::vector<std::uint32_t>& places,
                       Use&& use) {
    for (auto first = places.begin(); first != places.end();) {
      const auto after =
          std::upper_bound(runs.begin(), runs.end(), *first,
                           [](std::uint32_t place, const Run& run) { return place < run.first; });
      if (after == runs.begin() || *first >= std::prev(after)->first + std::prev(after)->count) {
        ++first;  // Belongs to no run.
        continue;
      }
      const Run& run = *std::prev(after);
      const auto end = std::lower_bound(first, places.end(), run.first + run.count);
      use(run, static_cast<std::uint32_t>(first - places.begin()),
          static_cast<std::uint32_t>(end - places.begin()));
      first = end;
    }
  }

  void take_mass_runs(const std::vector<std::uint32_t>& nodes, Program& program) const {
    each_run(program_.mass_runs, nodes, [&](MassRun run, std::uint32_t first, std::uint32_t end) {
      run.first = first;
      run.count = end - first;
      program.mass_runs.push_back(run);
    });
  }

  // Keeps the order of the whole, so that every sum is added in the same order.
  void take_link_runs(const std::vector<std::uint32_t>& nodes, Program& program) const {
    std::vector<std::uint32_t> links;
    for (const std::uint32_t node : nodes) {
      if (!bonds_.binds(node)) {
        continue;
      }
      bonds_.each_link(node, [&](std::uint32_t link) {
        const auto [a, b] = program_.ends[link];
        const bool is_first = node == (bonds_.binds(a) ? a : b);  // The first binding end.
        if (is_first && local_[a] != nobody && local_[b] != nobody) {
          links.push_back(link);
        }
      });
    }
    std::sort(links.begin(), links.end());
    // Removes links found from both ends.
    links.erase(std::unique(links.begin(), links.end()), links.end());
    each_run(program_.link_runs, links, [&](LinkRun run, std::uint32_t first, std::uint32_t end) {
      run.first = first;
      run.count = end - first;
      program.link_runs.push_back(run);
    });
    for (const std::uint32_t link : links) {
      const auto [a, b] = program_.ends[link];
      program.ends.push_back({local_[a], local_[b]});
    }
  }

  // Points do not move, so only the macro's nodes around them are kept.
  void take_taps(Program& program) const {
    for (TapSlot tap : program_.taps) {
      if (local_[tap.node] == nobody) {
        continue;
      }
      const auto [first, end] = bonds_.nodes_around(tap);
      tap.node = local_[tap.node];
      const auto kept = static_cast<std::uint32_t>(program.tap_nodes.size());
      for (std::uint32_t i = first; i != end; ++i) {
        const std::uint32_t node = local_[program_.tap_nodes[i]];
        program.tap_nodes.push_back(node != nobody ? node : 0);
      }
      tap.first += kept - first;
      program.taps.push_back(tap);
    }
  }

  void take_inputs(Shard& shard) const {
    for (std::uint32_t i = 0; i < program_.inputs.size(); ++i) {
      InputSlot input = program_.inputs[i];
      if (local_[input.node] != nobody) {
        input.node = local_[input.node];
        shard.program.inputs.push_back(input);
        shard.inputs.push_back(i);
      }
    }
  }

  void take_outputs(std::uint32_t s, Shard& shard) const {
    for (std::uint32_t i = 0; i < program_.outputs.size(); ++i) {
      OutputSlot output = program_.outputs[i];
      if (owner_[output.node] == s || (s == 0 && owner_[output.node] == nobody)) {
        output.node = local_[output.node];
        shard.program.outputs.push_back(output);
        shard.outputs.push_back(i);
      }
    }
  }

  const Bonds& bonds_;
  const Program& program_;
  const std::vector<std::uint32_t>& owner_;
  const std::uint32_t frames_;
  std::vector<bool> is_here_;         // [node]
  std::vector<std::uint32_t> local_;  // [node] Its index in the current shard.
};

std::vector<Shard> make_all(const Bonds& bonds, const Division& division, std::uint32_t frames) {
  std::vector<Shard> shards(division.own.size());
  Maker maker(bonds, division.owner, frames);
  for (std::uint32_t s = 0; s < shards.size(); ++s) {
    maker.make(s, division.own[s], shards[s]);
  }
  join_halos(shards, division.owner);
  return shards;
}

// Gives a shard, which has the direct form, the form that the whole has. Returns false if the shard
// has no such form, or if kernels of that form cannot be divided.
bool reform(Program& shard, const Form& whole) {
  const auto take = [&](auto form) {
    if (form) {
      shard.form = *std::move(form);
    }
    return form.has_value();
  };
  return whole.is<Direct>() || (whole.is<Chains>() && take(chains_form(shard))) ||
         (whole.is<Grid>() && take(grid_form(shard)));
}

// Converts all shards to the form of the whole; empty if one of them does not fit it.
std::vector<Shard> reformed(std::vector<Shard> shards, const Form& form) {
  for (Shard& shard : shards) {
    if (!reform(shard.program, form)) {
      return {};
    }
  }
  return shards;
}

// Returns the single-thread executor, shared by everything on this thread.
Executor* own_thread() {
  static OwnThread thread;
  return &thread;
}

// Candidate numbers of shards, of which the cheapest is taken.
struct Attempt {
  std::vector<std::size_t> counts;
  bool is_breadth_first = false;
  bool is_in_cache = false;  // Cheaper per mass than the whole.
};

// Returns the candidates: shards that stay in a cache, of which the first that pays is taken, then
// one shard per worker. Empty if neither can pay.
std::vector<Attempt> attempts_at(const Program& program, const Workload& load, double whole_ns) {
  std::vector<Attempt> attempts;
  const auto add_in = [&](const Cache& cache) {
    if (const std::size_t count = shards_in(cache, program.moving, load, most_shards); count > 1) {
      attempts.push_back({.counts = {count}, .is_in_cache = true});
    }
  };
  // A short shard of a chain has little overhead: 2n copied masses.
  if (program.form.is<Chains>()) {
    add_in(first_cache);
  }
  add_in(second_cache);
  const std::size_t workers = executor_of(load)->size();
  if (workers == 1 || whole_ns < least_shared_ns) {
    return attempts;
  }
  std::vector<std::size_t> counts;
  for (std::size_t count = workers; count > 1; count /= 2) {
    counts.push_back(count);
  }
  // The numbered order comes first, because it keeps equal rows together.
  attempts.push_back({.counts = counts});
  attempts.push_back({.counts = counts, .is_breadth_first = true});
  return attempts;
}

std::optional<Shards> made(const Program& program, const Bonds& bonds, const Division& division,
                           std::uint32_t frames, Executor* executor) {
  auto shards = reformed(make_all(bonds, division, frames), program.form);
  return shards.empty() ? std::nullopt
                        : std::optional(Shards{
                              .shards = std::make_shared<std::vector<Shard>>(std::move(shards)),
                              .executor = executor,
                              .frames = frames});
}

}  // namespace

std::vector<Shard> make_shards(const Program& program, std::size_t count, std::uint32_t frames) {
  const auto bonds = Bonds::of(program);
  return bonds ? make_all(*bonds, divide(*bonds, count, false), frames) : std::vector<Shard>();
}

Executor* executor_of(const Workload& load) {
  return load.executor != nullptr && load.executor->size() > 1 ? load.executor : own_thread();
}

std::optional<Shards> share_out(const Program& program, const Workload& load,
                                const Progress& progress) {
  Executor* const executor = executor_of(load);
  const std::size_t workers = executor->size();
  const double whole_ns = estimated_ns(program, load);
  const std::vector<Attempt> attempts = attempts_at(program, load, whole_ns);
  if (!is_plain(program) || !program.waveguides.empty() || attempts.empty()) {
    return std::nullopt;
  }
  const auto bonds = Bonds::of(program);
  if (!bonds) {
    return std::nullopt;
  }
  std::optional<Shards> best;
  double best_ns = whole_ns / least_gain;
  for (const Attempt& attempt : attempts) {
    std::uint32_t best_frames = 0;
    Division division;
    double least_ns = std::numeric_limits<double>::infinity();
    for (const std::size_t count : attempt.counts) {
      progress.spend(16 * program.position.size());
      Division tried = divide(*bonds, count, attempt.is_breadth_first);
      const auto [frames, ns] =
          best_meeting(tried.at_level, whole_ns / program.moving, std::min(workers, count));
      if (ns < least_ns) {
        least_ns = ns;
        best_frames = frames;
        division = std::move(tried);
      }
    }
    if (least_ns >= best_ns && !attempt.is_in_cache) {
      continue;
    }
    auto found = made(program, *bonds, division, best_frames, executor);
    progress.spend(64 * program.ends.size());
    if (!found) {
      continue;
    }
    if (const double ns = nominal_ns * operations(program, *found, load); ns < best_ns) {
      best_ns = ns;
      best = std::move(found);
      if (attempt.is_in_cache) {
        break;
      }
    }
  }
  return best;
}

}  // namespace ressort::kernels
