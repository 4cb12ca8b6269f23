// core/kernels: the store of a kernel that keeps a position and a velocity of every node, in
// whatever order its loops need them.
#pragma once

#include "core/kernels/kernel.h"
#include "core/kernels/passive/room.h"
#include "core/kernels/taps.h"

namespace ressort::kernels {

// Where positions are among a kernel's numbers: node[i] + lane[j]. What else there is of a node
// follows, `row` numbers further each: its velocity, then its force and the kernel's own.
struct NodeLayout {
  static constexpr std::uint32_t nowhere = 0xffffffffu;

  std::vector<std::uint32_t> node;  // [node], or nowhere: it is at 0 and stays there
  std::vector<std::uint32_t> lane;  // [lane]
  std::size_t row = 0;              // numbers
  std::size_t rows = 3;
  std::size_t size = 0;  // of all numbers
};

// One row after the other: [slot][lane], `slot` being where each node is in a row of `slots`.
template <class T>
NodeLayout layout_in_rows(std::span<const std::uint32_t> slot, std::size_t slots, std::size_t width,
                          std::size_t rows);

// The same, node by node.
template <class T>
NodeLayout layout_in_rows(const Program& program, std::size_t width, std::size_t rows);

// What is kept of where the places are, so that it is looked up only where one moves.
template <class T>
struct PlaceRoom {
  PlaceRoom(const Program& program, std::size_t width);

  Aligned<T> placed;  // [tap][u and v][lane] where it was in the last sample; at first nowhere
  // Of each tap, from `first` on: the nodes that it stands for in all lanes, and how much of each
  // it is, [node][lane]. A place on a macro that is between other nodes in each lane has none.
  Aligned<T> weights;
  std::vector<std::uint32_t> nodes;
  std::vector<std::size_t> first;    // [tap]
  std::vector<std::uint32_t> count;  // [tap]
};

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
  // A lane's nodes, with 0 in all other rows.
  void set(std::size_t lane, const double* x, const double* v);
  // All that changes, of others in the same layout.
  void become(const Nodes& from);

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

// The part of such a kernel that handles its nodes.
template <class T>
class NodeKernel : public Kernel<T> {
 public:
  void set_state(std::size_t lane, const double* x, const double* v) final;
  void let_go(std::size_t lane) final { nodes_.passive.awake[lane] = T(-1); }
  bool save(std::size_t lane, double* x, double* v) const final;
  bool read(std::span<const std::uint32_t> nodes, T* x, T* v) const final;
  void strike(std::size_t lane, std::span<const std::uint32_t> nodes,
              std::span<const double> changes) final;
  bool is_near_start(std::size_t lane, double bound) const final;
  std::size_t look(std::size_t lane, std::span<const std::uint32_t> nodes,
                   std::span<double> numbers) const final;

 protected:
  NodeKernel(const Program& program, NodeLayout layout)
      : Kernel<T>(program, layout.lane.size()),
        program_(program),
        nodes_(program, std::move(layout)) {}
  // All lanes to where the model starts: the last thing that a constructor does.
  void reset_lanes();
  // What become() does of coefficients and nodes; the rest is the kernel's own.
  const NodeKernel& become_nodes(const Kernel<T>& from) {
    const auto& other = static_cast<const NodeKernel&>(from);
    this->coefficients = other.coefficients;
    nodes_.become(other.nodes_);
    return other;
  }
  // What write_nodes() does where a kernel has it, but for the forces that links exert then.
  void write(std::span<const std::uint32_t> nodes, const T* x, const T* v);

  const Program& program_;
  Nodes<T> nodes_;

 private:
  // Whether the force on any node in the next sample is among its numbers already.
  virtual bool keeps_forces() const { return false; }
  // Whatever a lane has besides its nodes, as at the start.
  virtual void clear(std::size_t) {}
  // Whether that moves by less than `bound` a sample.
  virtual bool is_quiet(std::size_t, double) const { return true; }
};

}  // namespace ressort::kernels
