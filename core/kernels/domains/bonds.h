// core/kernels: the dependencies between the nodes of a Program from one sample to the next.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "core/kernels/program.h"

namespace ressort::kernels {

// The nodes around some others, sorted by their distance in links: those of a level are
// begin[level] to begin[level + 1].
struct Surroundings {
  std::vector<std::uint32_t> nodes;
  std::vector<std::size_t> begin;

  std::size_t count_at(std::size_t level) const { return begin[level + 1] - begin[level]; }
};

// Moving nodes, nodes whose force is an output, and points on macros are binding: the shard that
// steps them needs their neighbours. All other nodes may be duplicated in every shard. The Program
// must outlive it. [any thread but audio]
class Bonds {
 public:
  // Empty if a point moves over a macro, because it may be anywhere. O(nodes + links).
  static std::optional<Bonds> of(const Program& program);

  const Program& program() const { return program_; }
  std::size_t node_count() const { return binds_.size(); }
  bool binds(std::uint32_t node) const { return binds_[node]; }
  // Returns whether it has a binding neighbour.
  bool is_tied(std::uint32_t node) const { return is_tied_[node]; }
  bool is_point(std::uint32_t node) const { return node >= first_point_; }
  // Returns the nodes around the point, in single or double precision.
  const std::vector<std::uint32_t>& corners(std::uint32_t point) const {
    return corners_[point - first_point_];
  }
  // Returns the range of tap_nodes around the point.
  std::pair<std::uint32_t, std::uint32_t> nodes_around(const TapSlot& tap) const;

  // Calls use(node) for the nodes that act at a node: itself, the nodes around a point, or none.
  template <class Use>
  void each_behind(std::uint32_t node, Use&& use) const {
    if (!is_point(node)) {
      return binds_[node] ? use(node) : void();
    }
    for (const std::uint32_t corner : corners(node)) {
      if (binds_[corner]) {
        use(corner);
      }
    }
  }

  template <class Use>
  void each_neighbour(std::uint32_t node, Use&& use) const {
    neighbours_.each(node, use);
  }

  // Calls use(link) for the links at the node.
  template <class Use>
  void each_link(std::uint32_t node, Use&& use) const {
    links_.each(node, use);
  }

  // Return the binding nodes that are not points: as numbered, or breadth first from the first.
  std::vector<std::uint32_t> as_written() const;
  std::vector<std::uint32_t> breadth_first() const;

  // Returns the nodes at most `levels` links away from `own`. `is_seen`: [node] false before and
  // after.
  Surroundings surroundings(const std::vector<std::uint32_t>& own, std::uint32_t levels,
                            std::vector<bool>& is_seen) const;

 private:
  // One list per node, stored consecutively.
  struct Lists {
    template <class Use>
    void each(std::uint32_t node, Use&& use) const {
      for (std::size_t i = first[node]; i < first[node + 1]; ++i) {
        use(items[i]);
      }
    }
    std::vector<std::size_t> first;  // [node] Index of its first item.
    std::vector<std::uint32_t> items;
  };

  Bonds(const Program& program, std::vector<std::vector<std::uint32_t>> corners);
  template <class Use>
  void each_bond(Use&& use) const;
  template <class EachPair>
  Lists lists_of(EachPair&& each_pair) const;

  const Program& program_;
  std::vector<std::vector<std::uint32_t>> corners_;  // [tap] Nodes.
  std::uint32_t first_point_;                        // Points are the last nodes.
  std::vector<bool> binds_;                          // [node]
  std::vector<bool> is_tied_;                        // [node]
  Lists neighbours_;  // [node] Nodes that influence it within one sample.
  Lists links_;       // [node] Its links.
};

}  // namespace ressort::kernels
