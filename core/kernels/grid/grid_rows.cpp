#include "core/kernels/grid/grid_rows.h"

#include <algorithm>
#include <numeric>
#include <span>

namespace ressort::kernels {
namespace {

std::span<const std::uint32_t> neighbours_of(const GridGraph& graph, std::uint32_t node) {
  return std::span(graph.neighbours)
      .subspan(graph.start[node], graph.start[node + 1] - graph.start[node]);
}

class Walk {
 public:
  Walk(const GridGraph& graph, const Progress& progress)
      : graph_(graph),
        progress_(progress),
        is_seen_(graph.start.size() - 1),
        rank_(is_seen_.size(), nowhere),
        linked_to_(is_seen_.size(), nowhere) {}

  GridRows rows() {
    std::vector<std::uint32_t> order(is_seen_.size());
    std::iota(order.begin(), order.end(), 0u);
    std::stable_sort(order.begin(), order.end(),
                     [&](std::uint32_t a, std::uint32_t b) { return degree(a) < degree(b); });
    for (const std::uint32_t node : order) {
      if (!is_seen_[node] && degree(node) > 0) {
        rows_.push_back(side_from(node));
        while (add_next()) {
        }
      }
    }
    return std::move(rows_);
  }

 private:
  std::size_t degree(std::uint32_t node) const { return neighbours_of(graph_, node).size(); }

  // Returns the side from a corner to the next corner, along nodes with fewer neighbours than
  // inside.
  std::vector<std::uint32_t> side_from(std::uint32_t node) {
    std::vector<std::uint32_t> row = {node};
    is_seen_[node] = true;
    std::size_t side_degree = 0;
    for (;;) {
      const std::uint32_t before = row.size() > 1 ? row[row.size() - 2] : nowhere;
      progress_.spend(degree(row.back()) + 1);
      if (before != nowhere) {
        progress_.spend(degree(before));
        for (const std::uint32_t other : neighbours_of(graph_, before)) {
          linked_to_[other] = before;
        }
      }
      std::uint32_t next = nowhere;
      for (const std::uint32_t other : neighbours_of(graph_, row.back())) {
        const bool turns_back = before != nowhere && linked_to_[other] == before;
        if (!is_seen_[other] && !turns_back && (next == nowhere || degree(other) < degree(next))) {
          next = other;
        }
      }
      if (next == nowhere || (side_degree > 0 && degree(next) > side_degree)) {
        return row;
      }
      row.push_back(next);
      is_seen_[next] = true;
      side_degree = std::max(side_degree, degree(next));
      if (degree(next) < side_degree) {
        return row;
      }
    }
  }

  // Adds the neighbours of the last row as a path that starts at the same side.
  bool add_next() {
    std::vector<std::uint32_t> next;
    for (const std::uint32_t node : rows_.back()) {
      progress_.spend(3 * degree(node) + 1);
      for (const std::uint32_t other : neighbours_of(graph_, node)) {
        if (!is_seen_[other]) {
          is_seen_[other] = true;
          rank_[other] = static_cast<std::uint32_t>(next.size());
          next.push_back(other);
        }
      }
    }
    if (next.empty()) {
      return false;
    }
    std::vector<std::uint32_t> row;
    for (const bool ends_only : {true, false}) {
      for (const std::uint32_t node : next) {
        if (rank_[node] != nowhere && (!ends_only || within(node) <= 1)) {
          follow(node, row);
        }
      }
    }
    rows_.push_back(std::move(row));
    return true;
  }

  std::size_t within(std::uint32_t node) const {
    const auto all = neighbours_of(graph_, node);
    return static_cast<std::size_t>(std::count_if(
        all.begin(), all.end(), [&](std::uint32_t other) { return rank_[other] != nowhere; }));
  }

  void follow(std::uint32_t node, std::vector<std::uint32_t>& row) {
    while (node != nowhere) {
      row.push_back(node);
      rank_[node] = nowhere;
      std::uint32_t next = nowhere;
      for (const std::uint32_t other : neighbours_of(graph_, node)) {
        if (rank_[other] != nowhere && (next == nowhere || rank_[other] < rank_[next])) {
          next = other;
        }
      }
      node = next;
    }
  }

  const GridGraph& graph_;
  const Progress& progress_;
  std::vector<bool> is_seen_;
  std::vector<std::uint32_t> rank_;       // [node] Rank in the row being made, while it waits.
  std::vector<std::uint32_t> linked_to_;  // [node] The last node that it was found to be linked to.
  GridRows rows_;
};

}  // namespace

std::vector<bool> driven_nodes(const Program& program) {
  std::vector<bool> is_driven(program.position.size());
  for (const InputSlot& input : program.inputs) {
    if (!input.is_force) {
      is_driven[input.node] = true;
    }
  }
  for (const TapSlot& tap : program.taps) {
    is_driven[tap.node] = true;
  }
  return is_driven;
}

GridGraph grid_graph(const Program& program, std::uint32_t mass_run) {
  constexpr std::uint32_t most_of_a_ground = 8;
  const MassRun& masses = program.mass_runs[mass_run];
  const std::size_t nodes = program.position.size();
  const std::vector<bool> is_driven = driven_nodes(program);
  const auto is_mass = [&](std::uint32_t i) {
    return i >= masses.first && i - masses.first < masses.count;
  };
  const auto each_link = [&](auto&& use) {
    for (const LinkRun& run : program.link_runs) {
      for (std::uint32_t i = run.first; i < run.first + run.count; ++i) {
        if (run.count >= least_regular_links) {
          use(program.ends[i].a, program.ends[i].b);
        }
      }
    }
  };
  // A ground with one link would hide a corner, and one with many links has no single place.
  std::vector<std::uint32_t> degree(nodes);
  each_link([&](std::uint32_t a, std::uint32_t b) {
    ++degree[a];
    ++degree[b];
  });
  const auto belongs = [&](std::uint32_t i) {
    return is_mass(i) ||
           (i >= program.moving && !is_driven[i] && degree[i] > 1 && degree[i] <= most_of_a_ground);
  };
  const auto each_inner_link = [&](auto&& use) {
    each_link([&](std::uint32_t a, std::uint32_t b) {
      if (belongs(a) && belongs(b)) {
        use(a, b);
      }
    });
  };
  GridGraph graph;
  graph.start.resize(nodes + 1);
  each_inner_link([&](std::uint32_t a, std::uint32_t b) {
    ++graph.start[a + 1];
    ++graph.start[b + 1];
  });
  std::partial_sum(graph.start.begin(), graph.start.end(), graph.start.begin());
  graph.neighbours.resize(graph.start.back());
  std::vector<std::uint32_t> next(graph.start.begin(), graph.start.end() - 1);
  each_inner_link([&](std::uint32_t a, std::uint32_t b) {
    graph.neighbours[next[a]++] = b;
    graph.neighbours[next[b]++] = a;
  });
  return graph;
}

GridRows rows_as_written(const Program& program, const GridGraph& graph, const Progress& progress) {
  GridRows rows;
  bool follows = false;  // True if the node is linked to the one before.
  for (std::uint32_t node = 0; node < program.moving; ++node) {
    const auto all = neighbours_of(graph, node);
    progress.spend(all.size() + 1);
    if (!all.empty()) {
      if (!follows) {
        rows.emplace_back();
      }
      rows.back().push_back(node);
    }
    follows = std::find(all.begin(), all.end(), node + 1) != all.end();
  }
  return rows;
}

GridRows rows_by_walk(const GridGraph& graph, const Progress& progress) {
  return Walk(graph, progress).rows();
}

}  // namespace ressort::kernels
