#include "core/kernels/nodes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace ressort::kernels {

template <class T>
NodeLayout layout_in_rows(std::span<const std::uint32_t> slot, std::size_t slots, std::size_t width,
                          std::size_t rows) {
  constexpr std::size_t line = widest_bytes / sizeof(T);
  NodeLayout layout;
  for (const std::uint32_t at : slot) {
    layout.node.push_back(at < slots ? static_cast<std::uint32_t>(at * width)
                                     : NodeLayout::nowhere);
  }
  layout.lane.resize(width);
  std::iota(layout.lane.begin(), layout.lane.end(), 0u);
  // A cache line of padding separates the rows: addresses that differ by 4096 alias in the store
  // buffers of many processors.
  layout.row = (slots * width + line - 1) / line * line + line;
  layout.rows = rows;
  layout.size = rows * layout.row;
  return layout;
}

template <class T>
NodeLayout layout_in_rows(const Program& program, std::size_t width, std::size_t rows) {
  std::vector<std::uint32_t> slot(program.position.size());
  std::iota(slot.begin(), slot.end(), 0u);
  return layout_in_rows<T>(slot, slot.size(), width, rows);
}

template <class T>
PlaceRoom<T>::PlaceRoom(const Program& program, std::size_t width)
    : placed(program.taps.size() * 2 * width) {
  std::fill(placed.begin(), placed.end(), std::numeric_limits<T>::quiet_NaN());
  std::size_t rows = 0;
  for (const TapSlot& tap : program.taps) {
    first.push_back(rows);
    rows += tap.is_on_body() ? tap.length : tap_corners;
  }
  nodes.resize(rows);
  count.resize(program.taps.size());
  weights.resize(rows * width);
}

template <class T>
Nodes<T>::Nodes(const Program& program, NodeLayout layout_in)
    : layout(std::move(layout_in)),
      numbers(layout.size),
      corners(program.taps.size() * width()),
      places(program, width()),
      passive(program, width()) {}

template <class T>
double Nodes<T>::position(std::size_t node, std::size_t lane) const {
  return is_somewhere(node) ? static_cast<double>(numbers[at(node, lane)]) : 0.0;
}

template <class T>
double Nodes<T>::velocity(std::size_t node, std::size_t lane) const {
  return is_somewhere(node) ? static_cast<double>(numbers[at(node, lane) + layout.row]) : 0.0;
}

template <class T>
void Nodes<T>::push(std::size_t node, std::size_t lane, double force) {
  numbers[at(node, lane) + 2 * layout.row] += static_cast<T>(force);
}

template <class T>
void Nodes<T>::put(std::size_t node, std::size_t lane, double x, double v) {
  if (!is_somewhere(node)) {
    return;
  }
  T* const number = numbers.data() + at(node, lane);
  *number = static_cast<T>(x);
  number[layout.row] = static_cast<T>(v);
}

template <class T>
void Nodes<T>::set(std::size_t lane, const double* x, const double* v) {
  for (std::size_t node = 0; node < layout.node.size(); ++node) {
    for (std::size_t row = 2; is_somewhere(node) && row < layout.rows; ++row) {
      numbers[at(node, lane) + row * layout.row] = T(0);
    }
    put(node, lane, x[node], v[node]);
  }
  passive.awake[lane] = T(0);
}

template <class T>
void Nodes<T>::copy_from(const Nodes& from) {
  numbers = from.numbers;
  corners = from.corners;
  places.placed = from.places.placed;
  places.weights = from.places.weights;
  places.nodes = from.places.nodes;
  places.count = from.places.count;
  passive.memory = from.passive.memory;
  passive.awake = from.passive.awake;
  passive.felt = from.passive.felt;
}

template <class T>
void NodeKernel<T>::reset_lanes() {
  for (std::size_t lane = 0; lane < this->width(); ++lane) {
    this->reset(lane);
  }
}

template <class T>
void NodeKernel<T>::set_state(std::size_t lane, const double* x, const double* v) {
  clear(lane);
  nodes_.set(lane, x, v);
}

template <class T>
bool NodeKernel<T>::save(std::size_t lane, double* x, double* v) const {
  if (!program_.waveguides.empty()) {
    return false;  // There are other states than those of nodes.
  }
  for (std::size_t node = 0; node < program_.position.size(); ++node) {
    x[node] = nodes_.position(node, lane);
    v[node] = nodes_.velocity(node, lane);
  }
  return true;
}

template <class T>
bool NodeKernel<T>::read(std::span<const std::uint32_t> nodes, T* x, T* v) const {
  for (const std::uint32_t node : nodes) {
    for (std::size_t lane = 0; lane < this->width(); ++lane) {
      *x++ = static_cast<T>(nodes_.position(node, lane));
      *v++ = static_cast<T>(nodes_.velocity(node, lane));
    }
  }
  return true;
}

// A kernel that keeps forces adds the force that causes the change. A kernel that computes forces
// as the masses move adds the velocity; damping then acts on it in its own sample, by a share Z/M.
template <class T>
void NodeKernel<T>::strike(std::size_t lane, std::span<const std::uint32_t> nodes,
                           std::span<const double> changes) {
  const Coefficients<T>& now = this->coefficients;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const std::uint32_t node = nodes[i];
    if (keeps_forces()) {
      const std::uint32_t inverse_mass = run_of(program_, node).inverse_mass;
      nodes_.push(node, lane,
                  changes[i] / static_cast<double>(now.value[inverse_mass * now.width + lane]));
    } else {
      nodes_.put(node, lane, nodes_.position(node, lane), nodes_.velocity(node, lane) + changes[i]);
    }
  }
}

template <class T>
bool NodeKernel<T>::is_near_start(std::size_t lane, double bound) const {
  for (std::size_t node = 0; node < program_.moving; ++node) {
    if (!(std::fabs(nodes_.position(node, lane) - program_.position[node]) < bound)) {
      return false;
    }
  }
  return is_quiet(lane, bound);
}

template <class T>
std::size_t NodeKernel<T>::read_positions(std::size_t lane, std::span<const std::uint32_t> nodes,
                                          std::span<double> numbers) const {
  return copy_positions(nodes, numbers, [&](std::uint32_t node) {
    const double x = nodes_.position(node, lane);
    return is_junction(program_, node) ? x - nodes_.velocity(node, lane) / 2
                                       : x;  // as in its outputs
  });
}

template NodeLayout layout_in_rows<float>(std::span<const std::uint32_t>, std::size_t, std::size_t,
                                          std::size_t);
template NodeLayout layout_in_rows<double>(std::span<const std::uint32_t>, std::size_t, std::size_t,
                                           std::size_t);
template NodeLayout layout_in_rows<float>(const Program&, std::size_t, std::size_t);
template NodeLayout layout_in_rows<double>(const Program&, std::size_t, std::size_t);
template struct Nodes<float>;
template struct Nodes<double>;
template class NodeKernel<float>;
template class NodeKernel<double>;

}  // namespace ressort::kernels
