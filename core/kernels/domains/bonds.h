// core/kernels: who feels whom in a Program, from one sample to the next.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "core/kernels/program.h"

namespace ressort::kernels {

// The nodes around some, those that are so many links away one after the other: level by level from
// begin[level] to begin[level + 1].
struct Surroundings {
  std::vector<std::uint32_t> nodes;
  std::vector<std::size_t> begin;

  std::size_t count_at(std::size_t level) const { return begin[level + 1] - begin[level]; }
};

// What moves, what is heard by its force, and points on macros bind: whoever steps them needs what
// they are tied to. Of everything else there may be one in every shard. The Program outlives it.
// [any thread but audio]
class Bonds {
 public:
  // Nothing where a point wanders over a macro, as it may be anywhere. O(nodes + links).
  static std::optional<Bonds> of(const Program& program);

  const Program& program() const { return program_; }
  std::size_t node_count() const { return binds_.size(); }
  bool binds(std::uint32_t node) const { return binds_[node]; }
  bool is_tied(std::uint32_t node) const { return is_tied_[node]; }  // to one that binds
  bool is_point(std::uint32_t node) const { return node >= first_point_; }
  // The nodes around it, in single precision or in double.
  const std::vector<std::uint32_t>& corners(std::uint32_t point) const {
    return corners_[point - first_point_];
  }
  // From first to end in tap_nodes.
  std::pair<std::uint32_t, std::uint32_t> nodes_around(const TapSlot& tap) const;

  // Calls use(node) for who acts where a node is: itself, the nodes around a point, or nobody.
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

  // Calls use(link) for the links that it is an end of.
  template <class Use>
  void each_link(std::uint32_t node, Use&& use) const {
    links_.each(node, use);
  }

  // Of what binds and is no point: as it is written, or breadth first from the first one.
  std::vector<std::uint32_t> as_written() const;
  std::vector<std::uint32_t> breadth_first() const;

  // What is so many links away from `own` or less. `is_seen`: [node] false, before and after.
  Surroundings surroundings(const std::vector<std::uint32_t>& own, std::uint32_t levels,
                            std::vector<bool>& is_seen) const;

 private:
  // A list for every node, one after the other.
  struct Lists {
    template <class Use>
    void each(std::uint32_t node, Use&& use) const {
      for (std::size_t i = first[node]; i < first[node + 1]; ++i) {
        use(items[i]);
      }
    }
    std::vector<std::size_t> first;  // [node] of items
    std::vector<std::uint32_t> items;
  };

  Bonds(const Program& program, std::vector<std::vector<std::uint32_t>> corners);
  template <class Use>
  void each_bond(Use&& use) const;
  template <class EachPair>
  Lists lists_of(EachPair&& each_pair) const;

  const Program& program_;
  std::vector<std::vector<std::uint32_t>> corners_;  // [tap] nodes
  std::uint32_t first_point_;                        // points are the last nodes
  std::vector<bool> binds_;                          // [node]
  std::vector<bool> is_tied_;                        // [node]
  Lists neighbours_;                                 // who feels whom after one sample
  Lists links_;                                      // of which each is an end
};

}  // namespace ressort::kernels
