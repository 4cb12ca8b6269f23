#include "core/kernels/domains/shards.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/kernels/chains/chains_form.h"
#include "core/kernels/domains/halos.h"
#include "core/kernels/domains/one_by_one.h"
#include "core/kernels/domains/sharded_form.h"
#include "core/kernels/grid/grid_form.h"
#include "core/kernels/registry.h"
#include "core/kernels/taps.h"

namespace ressort::kernels {
namespace {

constexpr double least_shared_ns = 700.0;  // below, shards would wait more than compute
constexpr std::size_t most_shards = 32;    // each looks at all nodes once
constexpr double least_gain = 1.2;         // below, a core is better left to somebody else

// Calls use(place in tap_nodes) for the nodes around a point, in single precision and in double.
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

// The nodes around every point, in single precision or in double; nothing where one may wander.
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

// Who owns which node, and how many nodes are so many links away from a shard's own.
struct Division {
  std::vector<std::uint32_t> owner;                // [node] shard; nobody: it binds nobody
  std::vector<std::vector<std::size_t>> at_level;  // [shard][level], its own are at level 0
};

class Divider {
 public:
  Divider(const Program& program, std::vector<std::vector<std::uint32_t>> corners)
      : program_(program),
        corners_(std::move(corners)),
        first_point_(program.taps.empty() ? nobody : program.taps[0].node),
        binds_(program.position.size(), false),
        is_tied_(program.position.size(), false),
        first_(program.position.size() + 1, 0) {
    std::fill_n(binds_.begin(), program.moving, true);
    // The force on what does not move is the sum of all its links, wherever they lead.
    for (const OutputSlot& output : program.outputs) {
      binds_[output.node] = binds_[output.node] || output.is_force;
    }
    for (const TapSlot& tap : program.taps) {
      binds_[tap.node] = true;
    }
    find_neighbours();
  }

  // Along the order in which the nodes are written, or breadth first from the first one.
  Division divide(std::size_t count, bool is_breadth_first) const {
    std::vector<std::uint32_t> order = is_breadth_first ? breadth_first() : as_written();
    Division division{.owner = std::vector<std::uint32_t>(binds_.size(), nobody), .at_level = {}};
    for (std::size_t i = 0; i < order.size(); ++i) {
      division.owner[order[i]] = static_cast<std::uint32_t>(i * count / order.size());
    }
    for (std::size_t i = 0; i < corners_.size(); ++i) {
      const auto first = std::find_if(corners_[i].begin(), corners_[i].end(),
                                      [&](std::uint32_t node) { return binds_[node]; });
      division.owner[program_.taps[i].node] =
          first == corners_[i].end() ? 0 : division.owner[*first];
    }
    std::vector<std::uint32_t> level;
    for (std::uint32_t shard = 0; shard < count; ++shard) {
      find_levels(division.owner, shard, level);
      auto& at_level = division.at_level.emplace_back(most_levels + 1);
      for (const std::uint32_t here : level) {
        if (here != nobody) {
          ++at_level[here];
        }
      }
    }
    return division;
  }

  std::vector<Shard> make(const Division& division, std::uint32_t frames) const {
    std::vector<Shard> shards(division.at_level.size());
    for (std::uint32_t s = 0; s < shards.size(); ++s) {
      make_program(division.owner, s, frames, shards[s]);
    }
    join_halos(shards, [&](std::uint32_t node) { return division.owner[node]; });
    return shards;
  }

  // One of them, of nodes whose owners are known but for what binds nobody.
  Shard make_one(std::vector<std::uint32_t> owner, std::uint32_t shard,
                 std::uint32_t frames) const {
    for (std::uint32_t node = 0; node < owner.size(); ++node) {
      owner[node] = binds_[node] ? owner[node] : nobody;
    }
    Shard made;
    make_program(owner, shard, frames, made);
    return made;
  }

 private:
  bool is_point(std::uint32_t node) const { return node >= first_point_; }

  // Calls use(node) for who acts where a node is: itself, the nodes around a point, or nobody.
  template <class Use>
  void each_behind(std::uint32_t node, Use&& use) const {
    if (!is_point(node)) {
      return binds_[node] ? use(node) : void();
    }
    for (const std::uint32_t corner : corners_[node - first_point_]) {
      if (binds_[corner]) {
        use(corner);
      }
    }
  }

  // Calls use(a, b), in either order, for all who feel each other after one sample.
  template <class Use>
  void each_bond(Use&& use) const {
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

  void find_neighbours() {
    for (const auto& [a, b] : program_.ends) {
      is_tied_[a] = is_tied_[a] || binds_[b];
      is_tied_[b] = is_tied_[b] || binds_[a];
    }
    each_bond([&](std::uint32_t a, std::uint32_t b) {
      ++first_[a + 1];
      ++first_[b + 1];
    });
    std::partial_sum(first_.begin(), first_.end(), first_.begin());
    neighbours_.resize(first_.back());
    std::vector<std::size_t> next(first_.begin(), first_.end() - 1);
    each_bond([&](std::uint32_t a, std::uint32_t b) {
      neighbours_[next[a]++] = b;
      neighbours_[next[b]++] = a;
    });
  }

  template <class Use>
  void each_neighbour(std::uint32_t node, Use&& use) const {
    for (std::size_t i = first_[node]; i < first_[node + 1]; ++i) {
      use(neighbours_[i]);
    }
  }

  std::vector<std::uint32_t> as_written() const {
    std::vector<std::uint32_t> order;
    for (std::uint32_t node = 0; node < binds_.size(); ++node) {
      if (binds_[node] && !is_point(node)) {
        order.push_back(node);
      }
    }
    return order;
  }

  std::vector<std::uint32_t> breadth_first() const {
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

  // level[node]: how many links it is away from the shard's own; nobody: farther than needed.
  void find_levels(const std::vector<std::uint32_t>& owner, std::uint32_t shard,
                   std::vector<std::uint32_t>& level) const {
    level.assign(owner.size(), nobody);
    std::vector<std::uint32_t> now;
    std::vector<std::uint32_t> next;
    for (std::uint32_t node = 0; node < owner.size(); ++node) {
      if (owner[node] == shard) {
        level[node] = 0;
        now.push_back(node);
      }
    }
    for (std::uint32_t reached = 1; reached <= most_levels; ++reached) {
      for (const std::uint32_t node : now) {
        each_neighbour(node, [&](std::uint32_t neighbour) {
          if (level[neighbour] == nobody) {
            level[neighbour] = reached;
            next.push_back(neighbour);
          }
        });
      }
      now.swap(next);
      next.clear();
    }
  }

  // A point needs all that is around it; what is around an own one is near enough.
  bool has_corners(std::uint32_t point, const std::vector<std::uint32_t>& level,
                   std::uint32_t frames) const {
    bool has_all = true;
    each_behind(point, [&](std::uint32_t corner) {
      has_all = has_all && level[corner] <= frames + spare_levels;
    });
    return has_all;
  }

  // What does not move goes to whoever it is tied to. The first shard has what nobody has, and
  // listens to all of it.
  std::vector<bool> nodes_of(const std::vector<std::uint32_t>& owner, std::uint32_t shard,
                             std::uint32_t frames) const {
    std::vector<std::uint32_t> level;
    find_levels(owner, shard, level);
    std::vector<bool> is_here(binds_.size());
    for (std::uint32_t node = 0; node < is_here.size(); ++node) {
      is_here[node] = is_point(node) ? has_corners(node, level, frames)
                                     : level[node] <= frames + spare_levels ||
                                           (shard == 0 && !binds_[node] && !is_tied_[node]);
    }
    for (std::size_t i = 0; i < corners_.size(); ++i) {
      for (const std::uint32_t corner : corners_[i]) {
        is_here[corner] = is_here[corner] || is_here[program_.taps[i].node];
      }
    }
    for (const auto& [a, b] : program_.ends) {
      if (!binds_[a] && binds_[b] && is_here[b]) {
        is_here[a] = true;
      } else if (!binds_[b] && binds_[a] && is_here[a]) {
        is_here[b] = true;
      }
    }
    for (const OutputSlot& output : program_.outputs) {
      is_here[output.node] = is_here[output.node] || (shard == 0 && !binds_[output.node]);
    }
    return is_here;
  }

  void make_program(const std::vector<std::uint32_t>& owner, std::uint32_t s, std::uint32_t frames,
                    Shard& shard) const {
    const std::vector<bool> is_here = nodes_of(owner, s, frames);
    Program& program = shard.program;
    program.rate_hz = program_.rate_hz;
    program.rate_ratio = program_.rate_ratio;
    program.audio_parameters = program_.audio_parameters;
    program.audio_coefficients = program_.audio_coefficients;
    program.parameters = program_.parameters;
    program.steps = program_.steps;
    program.coefficients = program_.coefficients;
    program.depending = program_.depending;
    std::vector<std::uint32_t> local(is_here.size(), nobody);
    for (std::uint32_t node = 0; node < is_here.size(); ++node) {
      if (is_here[node]) {
        local[node] = static_cast<std::uint32_t>(shard.nodes.size());
        shard.nodes.push_back(node);
        program.position.push_back(program_.position[node]);
        program.velocity.push_back(program_.velocity[node]);
        program.moving += node < program_.moving ? 1 : 0;
      }
    }
    take_runs(local, program);
    take_taps(local, program);
    for (std::uint32_t i = 0; i < program_.inputs.size(); ++i) {
      InputSlot input = program_.inputs[i];
      if (is_here[input.node]) {
        input.node = local[input.node];
        program.inputs.push_back(input);
        shard.inputs.push_back(i);
      }
    }
    for (std::uint32_t i = 0; i < program_.outputs.size(); ++i) {
      OutputSlot output = program_.outputs[i];
      if (owner[output.node] == s || (s == 0 && owner[output.node] == nobody)) {
        output.node = local[output.node];
        program.outputs.push_back(output);
        shard.outputs.push_back(i);
      }
    }
  }

  // In the order of the whole, so that every sum is added up in the same order.
  void take_runs(const std::vector<std::uint32_t>& local, Program& program) const {
    for (MassRun run : program_.mass_runs) {
      const auto begin = local.begin() + run.first;
      const auto end = begin + run.count;
      const auto is_here = [](std::uint32_t node) { return node != nobody; };
      run.count = static_cast<std::uint32_t>(std::count_if(begin, end, is_here));
      if (run.count > 0) {
        run.first = *std::find_if(begin, end, is_here);
        program.mass_runs.push_back(run);
      }
    }
    for (LinkRun run : program_.link_runs) {
      const auto first = static_cast<std::uint32_t>(program.ends.size());
      for (std::uint32_t link = run.first; link < run.first + run.count; ++link) {
        const auto [a, b] = program_.ends[link];
        if (local[a] != nobody && local[b] != nobody && (binds_[a] || binds_[b])) {
          program.ends.push_back({local[a], local[b]});
        }
      }
      run.first = first;
      run.count = static_cast<std::uint32_t>(program.ends.size()) - first;
      if (run.count > 0) {
        program.link_runs.push_back(run);
      }
    }
  }

  // Points stay where they are, so that of a macro's nodes only those around them are kept.
  void take_taps(const std::vector<std::uint32_t>& local, Program& program) const {
    for (TapSlot tap : program_.taps) {
      if (local[tap.node] == nobody) {
        continue;
      }
      tap.node = local[tap.node];
      const auto [first, end] = nodes_around(tap);
      const auto kept = static_cast<std::uint32_t>(program.tap_nodes.size());
      for (std::uint32_t i = first; i != end; ++i) {
        const std::uint32_t node = local[program_.tap_nodes[i]];
        program.tap_nodes.push_back(node != nobody ? node : 0);
      }
      tap.first += kept - first;
      program.taps.push_back(tap);
    }
  }

  // Of tap_nodes, in either precision.
  std::pair<std::uint32_t, std::uint32_t> nodes_around(const TapSlot& tap) const {
    std::uint32_t first = nobody;
    std::uint32_t last = 0;
    each_corner_of(program_, tap, [&](std::uint32_t at) {
      first = std::min(first, at);
      last = std::max(last, at);
    });
    return {first, last + 1};
  }

  const Program& program_;
  std::vector<std::vector<std::uint32_t>> corners_;  // [tap] nodes
  std::uint32_t first_point_;                        // points are the last nodes
  std::vector<bool> binds_;  // [node] it moves, its force is heard, or it is a point: has an owner
  std::vector<bool> is_tied_;              // [node] to one that binds
  std::vector<std::size_t> first_;         // [node] of neighbours_
  std::vector<std::uint32_t> neighbours_;  // who feels whom after one sample
};

struct Reformer {
  Program& program;

  bool operator()(const Direct&) const { return true; }
  bool operator()(const Chains&) const { return take(chains_form(program)); }
  bool operator()(const Grid&) const { return take(grid_form(program)); }
  template <class Other>
  bool operator()(const Other&) const {
    return false;
  }

 private:
  template <class Found>
  bool take(std::optional<Found> form) const {
    if (!form) {
      return false;
    }
    program.form = *std::move(form);
    return true;
  }
};

// The same in the form of the whole; nothing if one of them does not have it.
std::vector<Shard> reformed(std::vector<Shard> shards, const Form& form) {
  for (Shard& shard : shards) {
    if (!std::visit(Reformer{shard.program}, form)) {
      return {};
    }
  }
  return shards;
}

// A way to divide.
struct Way {
  std::size_t count = 1;  // shards
  bool is_breadth_first = false;
  std::uint32_t frames = 0;

  // Those of the first of several processes.
  void follow_first(Fellows& fellows, std::size_t form) {
    std::uint32_t numbers[] = {static_cast<std::uint32_t>(form), static_cast<std::uint32_t>(count),
                               is_breadth_first ? 1u : 0u, frames};
    fellows.follow_first(numbers);
    count = numbers[1];
    is_breadth_first = numbers[2] != 0;
    frames = numbers[3];
  }
  bool operator==(const Way&) const = default;
};

// One thread's, which all that it plays may share.
Executor* own_thread() {
  static OwnThread thread;
  return &thread;
}

std::optional<Shards> made(const Program& program, const Divider& divider, const Division& division,
                           std::uint32_t frames, Executor* executor) {
  auto shards = reformed(divider.make(division, frames), program.form);
  return shards.empty() ? std::nullopt
                        : std::optional(Shards{
                              .shards = std::make_shared<std::vector<Shard>>(std::move(shards)),
                              .executor = executor,
                              .frames = frames});
}

}  // namespace

std::vector<Shard> make_shards(const Program& program, std::size_t count, std::uint32_t frames) {
  auto corners = corners_of(program);
  if (!corners) {
    return {};
  }
  const Divider divider(program, *std::move(corners));
  return divider.make(divider.divide(count, false), frames);
}

Executor* executor_of(const Workload& load) {
  return load.executor != nullptr && load.executor->size() > 1 ? load.executor : own_thread();
}

std::optional<Shard> make_shard(const Program& program, std::vector<std::uint32_t> owner,
                                std::uint32_t shard, std::uint32_t frames) {
  auto corners = corners_of(program);
  if (!corners) {
    return std::nullopt;
  }
  return Divider(program, *std::move(corners)).make_one(std::move(owner), shard, frames);
}

std::optional<Shards> share_out(const Program& program, const Workload& load,
                                const Progress& progress) {
  Executor* const executor = executor_of(load);
  const std::size_t workers = executor->size();
  Fellows* const fellows = executor->fellows();
  const double whole_ns = predicted_ns(program, load);
  const std::size_t many = shards_in_cache(program.moving, load, most_shards);
  const bool is_small = many == 1 && (workers == 1 || whole_ns < least_shared_ns);
  if (!is_plain(program) || !program.waveguides.empty() || (is_small && fellows == nullptr)) {
    return std::nullopt;
  }
  auto corners = corners_of(program);
  if (!corners) {
    return std::nullopt;
  }
  const Divider divider(program, *std::move(corners));
  std::vector<std::size_t> counts = {many};
  // Every process has a shard, or all of it.
  for (std::size_t count = workers; many == 1 && count > 1 && (count == workers || !fellows);
       count /= 2) {
    counts.push_back(count);
  }
  std::optional<Shards> best;
  Way best_way;
  double best_ns = whole_ns / least_gain;
  // As it is written first: rows that are alike stay so.
  for (const bool is_breadth_first : {false, true}) {
    if (is_small || (is_breadth_first && many > 1)) {
      continue;
    }
    Way way{.count = 1, .is_breadth_first = is_breadth_first};
    Division division;
    double least_ns = std::numeric_limits<double>::infinity();
    for (const std::size_t count : counts) {
      if (count == 1) {
        continue;
      }
      progress.spend(4 * count * program.position.size());
      Division tried = divider.divide(count, is_breadth_first);
      const auto [frames, ns] =
          best_meeting(tried.at_level, whole_ns / program.moving, std::min(workers, count));
      if (ns < least_ns) {
        least_ns = ns;
        way.count = count;
        way.frames = frames;
        division = std::move(tried);
      }
    }
    if (least_ns >= best_ns && many == 1) {
      continue;
    }
    auto found = made(program, divider, division, way.frames, executor);
    progress.spend(64 * program.ends.size());
    if (!found) {
      continue;
    }
    if (const double ns = predicted_ns(program, *found, load); ns < best_ns) {
      best_ns = ns;
      best = std::move(found);
      best_way = way;
    }
  }
  if (fellows != nullptr) {
    const Way own = best_way;
    best_way.follow_first(*fellows, program.form.index());
    if (best_way.count == 1) {
      return std::nullopt;
    }
    if (best_way != own) {
      best = made(program, divider, divider.divide(best_way.count, best_way.is_breadth_first),
                  best_way.frames, executor);
    }
  }
  return best;
}

}  // namespace ressort::kernels
