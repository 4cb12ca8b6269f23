// core/kernels: the memory of a kernel that keeps a position and a velocity of every node, in the
// order that its loops need.
#pragma once

#include "core/kernels/kernel.h"
#include "core/kernels/passive/room.h"
#include "core/kernels/taps.h"

namespace ressort::kernels {

// The memory layout of nodes: the position of a node in a lane is at node[i] + lane[j]. Its
// velocity, its force and further numbers of the kernel follow at distances of `row`.
struct NodeLayout {
  static constexpr std::uint32_t nowhere = 0xffffffffu;

  std::vector<std::uint32_t> node;  // [node] or nowhere: the node is fixed at 0
  std::vector<std::uint32_t> lane;  // [lane]
  std::size_t row = 0;              // numbers
  std::size_t rows = 3;
  std::size_t size = 0;  // total size in numbers
};

// Returns a layout of rows [slot][lane]. `slot` has the slot of each node, and a row has `slots`.
template <class T>
NodeLayout layout_in_rows(std::span<const std::uint32_t> slot, std::size_t slots, std::size_t width,
                          std::size_t rows);

// Returns a layout of rows [node][lane].
template <class T>
NodeLayout layout_in_rows(const Program& program, std::size_t width, std::size_t rows);

// Cached weights of the places, which are computed again only if a coordinate changes.
template <class T>
struct PlaceRoom {
  PlaceRoom(const Program& program, std::size_t width);

  Aligned<T> placed;  // [tap][u and v][lane] coordinates of the last sample; NaN at first
  // The nodes that a tap interpolates between and their weights, [node][lane], from `first` on.
  // A tap that is between different nodes in each lane has none.
  Aligned<T> weights;
  std::vector<std::uint32_t> nodes;
  std::vector<std::size_t> first;    // [tap]
  std::vector<std::uint32_t> count;  // [tap]
};

// The numbers of all nodes.
template <class T>
struct Nodes {
  Nodes(const Program& program, NodeLayout layout);

  std::size_t width() const { return layout.lane.size(); }
  T* row(std::size_t i) { return numbers.data() + i * layout.row; }
  void fill_row(std::size_t i, T value) { std::fill_n(row(i), layout.row, value); }

  double position(std::size_t node, std::size_t lane) const;
  double velocity(std::size_t node, std::size_t lane) const;
  void push(std::size_t node, std::size_t lane, double force);
  void put(std::size_t node, std::size_t lane, double x, double v);
  // Sets the nodes of a lane and clears all other rows.
  void set(std::size_t lane, const double* x, const double* v);
  // Copies all state from nodes of the same layout.
  void copy_from(const Nodes& from);

  NodeLayout layout;
  Aligned<T> numbers;
  std::vector<Corners<T>> corners;  // [tap][lane] in the last sample
  PlaceRoom<T> places;
  PassiveRoom<T> passive;

 private:
  bool is_somewhere(std::size_t node) const { return layout.node[node] != NodeLayout::nowhere; }
  std::size_t at(std::size_t node, std::size_t lane) const {
    return layout.node[node] + layout.lane[lane];
  }
};

// A kernel with such a memory.
template <class T>
class NodeKernel : public Kernel<T> {
 public:
  void set_state(std::size_t lane, const double* x, const double* v) final;
  void disable_links(std::size_t lane) final { nodes_.passive.awake[lane] = T(-1); }
  bool save(std::size_t lane, double* x, double* v) const final;
  bool read(std::span<const std::uint32_t> nodes, T* x, T* v) const final;
  void strike(std::size_t lane, std::span<const std::uint32_t> nodes,
              std::span<const double> changes) final;
  bool is_near_start(std::size_t lane, double bound) const final;
  std::size_t read_positions(std::size_t lane, std::span<const std::uint32_t> nodes,
                             std::span<double> numbers) const final;

 protected:
  NodeKernel(const Program& program, NodeLayout layout)
      : Kernel<T>(program, layout.lane.size()),
        program_(program),
        nodes_(program, std::move(layout)) {}
  // Sets all lanes to the initial state. A constructor calls it last.
  void reset_lanes();
  // Copies coefficients and nodes: a part of copy_from().
  const NodeKernel& copy_nodes(const Kernel<T>& from) {
    const auto& other = static_cast<const NodeKernel&>(from);
    this->coefficients = other.coefficients;
    nodes_.copy_from(other.nodes_);
    return other;
  }

  const Program& program_;
  Nodes<T> nodes_;

 private:
  // Returns whether the kernel already has the forces of the next sample.
  virtual bool keeps_forces() const { return false; }
  // Resets the state of a lane besides its nodes.
  virtual void clear(std::size_t) {}
  // Returns whether that state changes by less than `bound` per sample.
  virtual bool is_quiet(std::size_t, double) const { return true; }
};

}  // namespace ressort::kernels
